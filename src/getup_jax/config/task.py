"""The get-up task."""

from __future__ import annotations

import dataclasses
import math

from getup_jax.config.check import require
from getup_jax.config.ranges import check_numbers, number

# settings with which lying bodies on flat ground have the motions' own poses
OWN_POSES = {"limp_share": 0.0, "fallen_share": 0.0, "drop_as": "limp"}


@dataclasses.dataclass(frozen=True)
class TaskConfig:
    """The get-up task: episodes, starts, early ends and the action."""

    stand_time_s: float = number(3.0, above=0, most=600)  # standing phase after the curve's end
    # when the curve targets are seen
    lookahead_s: tuple[float, ...] = number((0.0, 0.1, 0.2, 0.3), least=0, most=60, length=(1, 32))
    filter: float = number(0.2, above=0, most=1)  # share of the new action in the filtered one
    offset_scale: float = number(1.0, least=0, most=10)  # rad, PD offset of a filtered action of 1
    # c of the naturalness reward (equation 3)
    offset_limit_rad: float = number(10.0, above=0, most=1000)
    # reward terms of users by name, with exponents: factors of the reward, see docs/extending.md
    rewards: dict[str, float] = number({}, above=0, most=100)
    # how far past a joint limit a PD target may lie
    target_margin_rad: float = number(0.5, least=0, most=10)
    terminate_reward: float = number(0.1, least=0, most=1)  # early end below this task reward ...
    # ... or with the head on the floor, for this long
    terminate_after_s: float = number(0.3, least=0, most=3600)
    # the head is on the floor below this gap
    head_clearance_m: float = number(0.02, least=0, most=10)
    stand_start: float = number(0.3, least=0, most=1)  # share of episodes that start standing
    # largest gap between a curve's and a pose's torso angles
    curve_match_rad: float = number(0.52, least=0, most=math.pi)
    start_noise_rad: float = number(0.0, least=0, most=math.pi)  # joint noise of the start poses
    pool_size: int = number(2048, least=1, most=262_144)  # start states made once
    # lying starts rest this long before the pool keeps them
    settle_s: float = number(0.5, least=0, most=3600)
    # share of the lying starts on flat ground that are limp bodies, not the motions' own poses; on
    # irregular ground all of them are
    limp_share: float = number(0.0, least=0, most=1)
    # how these are dropped: limp | any | paper | varied, see DROPS in rag_doll.py
    drop_as: str = "limp"
    # how many on flat ground; terrain.drops on irregular ground
    limp_drops: int = number(1000, least=1, most=1_000_000)
    # share of them that stood, were pushed and fell
    fallen_share: float = number(0.0, least=0, most=1)

    def __post_init__(self) -> None:
        check_numbers(self, "task")
        now = self.lookahead_s[:1] == (0.0,)
        require(now, "task.lookahead_s", "times that start with 0, the present", self.lookahead_s)
        drops = ("limp", "any", "paper", "varied")
        require(self.drop_as in drops, "task.drop_as", f"one of {drops}", self.drop_as)
