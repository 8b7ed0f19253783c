"""The get-up task."""

from __future__ import annotations

import dataclasses
import math

from getup_jax.config.check import require


@dataclasses.dataclass(frozen=True)
class TaskConfig:
    """The get-up task: episodes, starts, early ends and the action."""

    stand_time_s: float = 3.0  # standing phase after the curve's end
    lookahead_s: tuple[float, ...] = (0.0, 0.1, 0.2, 0.3)  # when the curve targets are seen
    filter: float = 0.2  # share of the new action in the filtered one
    offset_scale: float = 1.0  # rad, PD offset of a filtered action of 1
    offset_limit_rad: float = 10.0  # c of the naturalness reward (equation 3)
    target_margin_rad: float = 0.5  # how far past a joint limit a PD target may lie
    terminate_reward: float = 0.1  # early end below this task reward ...
    terminate_after_s: float = 0.3  # ... or with the head on the floor, for this long
    head_clearance_m: float = 0.02  # the head is on the floor below this gap
    # while training: for this long a head that is on the floor for too long only costs the reward;
    # limp bodies that came to rest face down must learn to raise it
    head_grace_s: float = 0.0
    stand_start: float = 0.3  # share of episodes that start standing
    clip_start: float = 0.0  # share that starts along the reference clip, or one that fits
    # on irregular ground too, turned towards its slope and set down on it
    clip_everywhere: bool = False
    # folder of getup-search, or `authored`, the shipped one; clip starts, if any, are at its states
    paths: str | None = None
    path_share: float = 0.6  # share of the clip starts that are, where there are states
    short_share: float = 0.0  # share of the lying and clip starts whose episodes are cut short ...
    short_s: float = 1.5  # ... after this long: more tries of what comes next for the same steps
    assist: float = (
        0.0  # share of the weight that a helping hand lifts at most, until starts succeed
    )
    assist_s: float = math.inf  # it lets go so long after the start, in any case
    assist_rates: tuple[float, float] = (0.02, 0.01)  # less of it for a success, more for a failure
    assist_share: float = 0.5  # share of the lying and clip starts with the hand; needs focus
    curve_match_rad: float = 0.52  # largest gap between a curve's and a pose's torso angles
    # 0: starts are drawn evenly; towards 1: at the frontier of what is learned, and on irregular
    # ground in regions where more fails
    focus: float = 0.0
    focus_even: bool = False  # as often for a style with one part at the frontier as with ten
    start_noise_rad: float = 0.0  # joint noise of the start poses
    pool_size: int = 2048  # start states made once
    settle_s: float = 0.5  # lying starts rest this long before the pool keeps them
    # share of the lying starts on flat ground that are limp bodies, not the motions' own poses; on
    # irregular ground all of them are
    limp_share: float = 0.0
    drop_as: str = "limp"  # how these are dropped: limp | any | paper, see DROPS in tasks/falls.py
    limp_drops: int = 1000  # how many on flat ground; terrain.drops on irregular ground
    fallen_share: float = 0.0  # share of them that stood, were pushed and fell

    def __post_init__(self) -> None:
        share = self.stand_start + self.clip_start
        require(0 <= share <= 1, "task.stand_start + task.clip_start", "between 0 and 1", share)
        require(0 <= self.focus < 1, "task.focus", "at least 0 and less than 1", self.focus)
        require(0 <= self.short_share < 1, "task.short_share", "0 to below 1", self.short_share)
        require(self.assist >= 0, "task.assist", "at least 0", self.assist)
        ok = min(self.assist_rates) > 0
        require(ok, "task.assist_rates", "two numbers more than 0", self.assist_rates)
        require(self.assist_s > 0, "task.assist_s", "more than 0", self.assist_s)
        ok = self.assist == 0 or self.focus > 0
        require(ok, "task.focus", "more than 0 where task.assist is", self.focus)
        ok = 0 <= self.assist_share < 1
        require(ok, "task.assist_share", "at least 0 and less than 1", self.assist_share)
        require(self.head_grace_s >= 0, "task.head_grace_s", "at least 0", self.head_grace_s)
        require(self.short_s > 0, "task.short_s", "more than 0", self.short_s)
        require(0 <= self.path_share <= 1, "task.path_share", "between 0 and 1", self.path_share)
        require(0 < self.filter <= 1, "task.filter", "more than 0 and at most 1", self.filter)
        now = self.lookahead_s[:1] == (0.0,)
        require(now, "task.lookahead_s", "times that start with 0, the present", self.lookahead_s)
        require(self.pool_size > 0, "task.pool_size", "more than 0", self.pool_size)
        for name in ("limp_share", "fallen_share"):
            share = getattr(self, name)
            require(0 <= share <= 1, f"task.{name}", "between 0 and 1", share)
        drops = ("limp", "any", "paper")
        require(self.drop_as in drops, "task.drop_as", f"one of {drops}", self.drop_as)
        require(self.limp_drops > 0, "task.limp_drops", "more than 0", self.limp_drops)
