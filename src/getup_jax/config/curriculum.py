"""What only helps to train to get up; an evaluation has none of it."""

from __future__ import annotations

import dataclasses
import math

from getup_jax.config.check import require
from getup_jax.config.ranges import check_numbers, number


@dataclasses.dataclass(frozen=True)
class CurriculumConfig:
    """Which starts, how much help, which curves, and which rewards train; the defaults are none.

    The regions of irregular ground, which open one after the other, are `terrain.curriculum`.
    """

    # reference state initialisation: share of the episodes that begin along the reference motion
    reference_start: float = number(0.0, least=0, most=1)
    # on irregular ground too, turned towards its slope and set down on it
    reference_everywhere: bool = False
    # archived states that stand in for those of the motion: a folder of getup-search, or
    # `authored`, the shipped ones
    archive: str | None = None
    # share of the reference starts that they are, where there are some
    archive_share: float = number(0.6, least=0, most=1)
    # start prioritisation (a reverse curriculum), 0: starts are drawn evenly; towards 1: at the
    # frontier of what is learned, and on irregular ground in regions where more fails
    prioritisation: float = number(0.0, least=0, below=1)
    even_styles: bool = False  # as often for a style with one part at the frontier as with ten
    # share of the lying and reference starts whose episodes are cut short ...
    short_share: float = number(0.0, least=0, below=1)
    # ... after this long: more tries of what comes next for the same steps
    short_s: float = number(1.5, above=0, most=3600)
    # assistive wrench on the pelvis: most share of the weight that it lifts, until starts succeed
    assistive_wrench: float = number(0.0, least=0, most=10)
    # share of the lying and reference starts that have it
    assisted_share: float = number(0.5, least=0, below=1)
    # for this long a head that is on the floor for too long only costs the reward; limp bodies
    # that came to rest face down must learn to raise it
    head_grace_s: float = number(0.0, least=0, most=3600)
    # random pushes on the trunk, horizontal, of U(0, this) (Ns); 0: none
    push_ns: float = number(0.0, least=0, most=1000)
    push_interval_s: float = number(4.0, above=0, most=3600)  # mean time between two
    # share of the episodes whose curves are drawn: blends of styles that start alike, their control
    # points moved by smooth noise, over other durations; see drawn_curves.py
    drawn_curves: float = number(0.0, least=0, most=1)
    # of drawn curves; 1: rms of .08 m, 10 degrees (side), 12 (front)
    curve_noise: float = number(1.0, least=0, most=10)
    # of drawn curves: T x U(low, high)
    duration_range: tuple[float, float] = number((0.75, 1.3), above=0, most=100, length=2)
    # share of the drawn curves that go over to a style which may start otherwise ...
    style_transitions: float = number(0.0, least=0, most=1)
    # ... by up to this, in both angles of the torso: 1.2 is from a side to prone
    transition_rad: float = number(1.2, least=0, most=math.pi)
    # share of the drawn curves of lying starts that begin where the body is, not with their style
    start_at_pose: float = number(0.0, least=0, most=1)
    # product: all reward terms multiplied, with one critic | terms: each with a critic of its own
    objectives: str = "product"
    # exponent on the height and orientation terms of the reward; 1: as in the paper. Early ends,
    # return rates and reward_task are always those of 1
    reward_sharpness: float = number(1.0, above=0, most=100)
    # weight of another objective with a critic of its own, beside 1 of the task's: tracking alone,
    # with a sharpness of its own; 0: off
    track_weight: float = number(0.0, least=0, most=1000)
    # exponent on the height and orientation terms in it
    track_sharpness: float = number(3.0, above=0, most=100)
    # that of the height term, if another: an error of .05 m costs half of what one of .1 rad does;
    # None: track_sharpness
    track_height_sharpness: float | None = number(None, above=0, most=100)
    # of its returns: how a curve is followed shows at once, whether one stands only at the end;
    # None: ppo.discount
    track_discount: float | None = number(None, least=0, below=1)

    def __post_init__(self) -> None:
        check_numbers(self, "curriculum")
        ok = self.assistive_wrench == 0 or self.prioritisation > 0
        expected = "more than 0 where curriculum.assistive_wrench is"
        require(ok, "curriculum.prioritisation", expected, self.prioritisation)
        low, high = self.duration_range
        expected = "two numbers, the smaller one first"
        require(low <= high, "curriculum.duration_range", expected, self.duration_range)
        kinds = ("product", "terms")
        ok = self.objectives in kinds
        require(ok, "curriculum.objectives", f"one of {kinds}", self.objectives)
