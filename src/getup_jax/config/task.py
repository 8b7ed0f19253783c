"""The get-up task."""

from __future__ import annotations

import dataclasses
import math

from getup_jax.config.check import require
from getup_jax.config.ranges import check_numbers, number


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
    # how far past a joint limit a PD target may lie
    target_margin_rad: float = number(0.5, least=0, most=10)
    terminate_reward: float = number(0.1, least=0, most=1)  # early end below this task reward ...
    # ... or with the head on the floor, for this long
    terminate_after_s: float = number(0.3, least=0, most=3600)
    # the head is on the floor below this gap
    head_clearance_m: float = number(0.02, least=0, most=10)
    # while training: for this long a head that is on the floor for too long only costs the reward;
    # limp bodies that came to rest face down must learn to raise it
    head_grace_s: float = number(0.0, least=0, most=3600)
    stand_start: float = number(0.3, least=0, most=1)  # share of episodes that start standing
    # share that starts along the reference clip, or one that fits
    clip_start: float = number(0.0, least=0, most=1)
    # on irregular ground too, turned towards its slope and set down on it
    clip_everywhere: bool = False
    # folder of getup-search, or `authored`, the shipped one; clip starts, if any, are at its states
    paths: str | None = None
    # share of the clip starts that are, where there are states
    path_share: float = number(0.6, least=0, most=1)
    # share of the lying and clip starts whose episodes are cut short ...
    short_share: float = number(0.0, least=0, below=1)
    # ... after this long: more tries of what comes next for the same steps
    short_s: float = number(1.5, above=0, most=3600)
    # share of the weight that a helping hand lifts at most, until starts succeed
    assist: float = number(0.0, least=0, most=10)
    # it lets go so long after the start, in any case
    assist_s: float = number(math.inf, above=0, most=math.inf)
    # less of it for a success, more for a failure
    assist_rates: tuple[float, float] = number((0.02, 0.01), above=0, most=1, length=2)
    # share of the lying and clip starts with the hand; needs focus
    assist_share: float = number(0.5, least=0, below=1)
    # exponent on the height and orientation terms of the reward; 1: as in the paper. Early ends,
    # return rates and reward_task are always those of 1
    sharpness: float = number(1.0, above=0, most=100)
    # weight of a second objective with a critic of its own, beside 1 of the task's: tracking alone,
    # with a sharpness of its own; 0: off
    track_weight: float = number(0.0, least=0, most=1000)
    track_sharpness: float = number(3.0, above=0, most=100)
    # largest gap between a curve's and a pose's torso angles
    curve_match_rad: float = number(0.52, least=0, most=math.pi)
    # 0: starts are drawn evenly; towards 1: at the frontier of what is learned, and on irregular
    # ground in regions where more fails
    focus: float = number(0.0, least=0, below=1)
    focus_even: bool = False  # as often for a style with one part at the frontier as with ten
    # share of the training episodes whose curves are drawn: blends of styles that start alike,
    # their control points moved by smooth noise, over other durations; see drawn_curves.py
    drawn_share: float = number(0.0, least=0, most=1)
    # of drawn curves; 1: rms of .08 m, 10 degrees (side), 12 (front)
    curve_noise: float = number(1.0, least=0, most=10)
    # of drawn curves: T x U(low, high)
    duration_range: tuple[float, float] = number((0.75, 1.3), above=0, most=100, length=2)
    start_noise_rad: float = number(0.0, least=0, most=math.pi)  # joint noise of the start poses
    pool_size: int = number(2048, least=1, most=262_144)  # start states made once
    # lying starts rest this long before the pool keeps them
    settle_s: float = number(0.5, least=0, most=3600)
    # share of the lying starts on flat ground that are limp bodies, not the motions' own poses; on
    # irregular ground all of them are
    limp_share: float = number(0.0, least=0, most=1)
    drop_as: str = "limp"  # how these are dropped: limp | any | paper, see DROPS in rag_doll.py
    # how many on flat ground; terrain.drops on irregular ground
    limp_drops: int = number(1000, least=1, most=1_000_000)
    # share of them that stood, were pushed and fell
    fallen_share: float = number(0.0, least=0, most=1)

    def __post_init__(self) -> None:
        check_numbers(self, "task")
        share = self.stand_start + self.clip_start
        require(share <= 1, "task.stand_start + task.clip_start", "at most 1", share)
        ok = self.assist == 0 or self.focus > 0
        require(ok, "task.focus", "more than 0 where task.assist is", self.focus)
        low, high = self.duration_range
        expected = "two numbers, the smaller one first"
        require(low <= high, "task.duration_range", expected, self.duration_range)
        now = self.lookahead_s[:1] == (0.0,)
        require(now, "task.lookahead_s", "times that start with 0, the present", self.lookahead_s)
        drops = ("limp", "any", "paper")
        require(self.drop_as in drops, "task.drop_as", f"one of {drops}", self.drop_as)
