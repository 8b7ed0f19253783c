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
    # exponent on the height and orientation terms of the reward; 1: as in the paper. Early ends,
    # return rates and reward_task are always those of 1
    sharpness: float = 1.0
    # weight of a second objective with a critic of its own, beside 1 of the task's: tracking alone,
    # with a sharpness of its own; 0: off
    track_weight: float = 0.0
    track_sharpness: float = 3.0
    curve_match_rad: float = 0.52  # largest gap between a curve's and a pose's torso angles
    # 0: starts are drawn evenly; towards 1: at the frontier of what is learned, and on irregular
    # ground in regions where more fails
    focus: float = 0.0
    focus_even: bool = False  # as often for a style with one part at the frontier as with ten
    # share of the training episodes whose curves are drawn: blends of styles that start alike,
    # their control points moved by smooth noise, over other durations; see tasks/drawn_curves.py
    drawn_share: float = 0.0
    curve_noise: float = 1.0  # of drawn curves; 1: rms of .08 m, 10 degrees (side), 12 (front)
    duration_range: tuple[float, float] = (0.75, 1.3)  # of drawn curves: T x U(low, high)
    start_noise_rad: float = 0.0  # joint noise of the start poses
    pool_size: int = 2048  # start states made once
    settle_s: float = 0.5  # lying starts rest this long before the pool keeps them

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
        for name in ("sharpness", "track_sharpness"):
            require(getattr(self, name) > 0, f"task.{name}", "more than 0", getattr(self, name))
        require(self.track_weight >= 0, "task.track_weight", "at least 0", self.track_weight)
        ok = 0 <= self.drawn_share <= 1
        require(ok, "task.drawn_share", "between 0 and 1", self.drawn_share)
        require(self.curve_noise >= 0, "task.curve_noise", "at least 0", self.curve_noise)
        low, high = self.duration_range
        expected = "two numbers of more than 0, the smaller one first"
        require(0 < low <= high, "task.duration_range", expected, self.duration_range)
        require(self.short_s > 0, "task.short_s", "more than 0", self.short_s)
        require(0 <= self.path_share <= 1, "task.path_share", "between 0 and 1", self.path_share)
        require(0 < self.filter <= 1, "task.filter", "more than 0 and at most 1", self.filter)
        now = self.lookahead_s[:1] == (0.0,)
        require(now, "task.lookahead_s", "times that start with 0, the present", self.lookahead_s)
        require(self.pool_size > 0, "task.pool_size", "more than 0", self.pool_size)
