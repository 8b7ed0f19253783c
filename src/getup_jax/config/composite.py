"""Composite motion: groups of links, their discriminators, and the objectives."""

from __future__ import annotations

import dataclasses
from dataclasses import field
from typing import Any

from getup_jax.config.check import require
from getup_jax.config.ranges import MOST_SAMPLES, Range, check, check_numbers, number

FASTEST_TURN = 2.0  # rad/s
_OF_GOALS = Range(least=-1e6, most=1e6)  # the goals have ranges of their own within it


@dataclasses.dataclass(frozen=True)
class GroupConfig:
    """Links that imitate clips of their own, judged by a discriminator of their own [C 4.1]."""

    # names of links, or of presets: upper, lower, arms, rest, full, left_arm, right_arm
    links: tuple[str, ...] = ()
    clips: tuple[str, ...] = ()  # names of authored clips, or motion files
    frame: str = "heading"  # heading: of the newest root | root: the root's own in every frame
    # n_i of equation 3; a window has 2 frames more, and the actor sees 3
    history: int = number(3, least=0, most=3)
    # range of the clips' pace, drawn for each window: slowest, fastest
    speed: tuple[float, ...] = number((1.0, 1.0), above=0, most=10, length=2)
    # rad/s, positive to the left: each clip is also bent along an arc on which it turns this fast;
    # 0 is the clip as it is
    turns: tuple[float, ...] = number(
        (0.0,), least=-FASTEST_TURN, most=FASTEST_TURN, length=(1, 64)
    )

    def __post_init__(self) -> None:
        check_numbers(self, "composite.groups.*")
        frames = ("heading", "root")
        require(self.frame in frames, "composite.groups.*.frame", f"one of {frames}", self.frame)
        slowest, fastest = self.speed
        ok = slowest <= fastest
        require(ok, "composite.groups.*.speed", "slowest <= fastest", self.speed)


@dataclasses.dataclass(frozen=True)
class DiscriminatorConfig:
    """One ensemble a group: a GRU over the window, dense layers, many heads [C 4.2]."""

    gru_size: int = number(256, least=1, most=4096)  # of the GRU over the frames
    # of the dense layers behind it
    hidden_sizes: tuple[int, ...] = number((256, 128), least=1, most=4096, length=(0, 8))
    heads: int = number(32, least=1, most=1024)  # N of equation 2
    gradient_penalty: float = number(10.0, least=0, most=10_000)  # lambda of equation 2
    # whose gradient is held at 1: sum, that of all heads together, as in the authors' release: the
    # mean of N heads then changes by at most 1 / N a unit of distance | head, each, as equation 2
    penalty_of: str = "sum"
    # share of an update's mixtures that it is taken at: its gradients are most of the cost
    penalty_share: float = number(1.0, above=0, most=1)
    # that norm; less than 1: the score still tells apart what is far from the clips
    gradient_norm: float = number(1.0, above=0, most=1000)
    learning_rate: float = number(1e-5, above=0, most=1)  # of Adam
    minibatch_size: int = number(256, least=1, most=MOST_SAMPLES)  # windows of an update
    # of a rollout's windows that an update learns from, drawn at random
    share: float = number(1.0, above=0, most=1)
    # features (m, and numbers of quaternions) that vary by less are not blown up to a std of 1:
    # clips hold many links still, and any noise of the actions would tell the two kinds apart
    least_std: float = number(0.0, least=0, most=100)

    def __post_init__(self) -> None:
        check_numbers(self, "composite.discriminator")
        kinds = ("sum", "head")
        ok = self.penalty_of in kinds
        key = "composite.discriminator.penalty_of"
        require(ok, key, f"one of {kinds}", self.penalty_of)


@dataclasses.dataclass(frozen=True)
class CompositeConfig:
    """Composite motion instead of getting up: many objectives, each with its own critic [C]."""

    groups: dict[str, GroupConfig] = field(default_factory=dict)
    shared_links: tuple[str, ...] = ()  # links that several groups may have
    free_links: tuple[str, ...] = ()  # links that need not be in any group
    # goal tasks by name with their settings, such as {target_location: {speed: [1.2, 1.5]}}
    goals: dict[str, dict[str, Any]] = field(default_factory=dict)
    weights: dict[str, float] = number({}, least=0, most=1)  # of objectives; empty: all the same
    multi_objective: bool = True  # False: one critic for the weighted sum of all rewards
    discriminator: DiscriminatorConfig = field(default_factory=DiscriminatorConfig)
    meta: str | None = None  # a composite policy whose actions this one weights and adds to [C 5]
    # what the meta policy sees: all | own: links with clips that it does not know, as they are in
    # its own clips where the other links look most alike
    meta_sees: str = "all"
    start_group: str | None = None  # episodes start along its clips; None: the last group's
    start_mixed: bool = False  # and with the other groups' hinges from their own clips
    # before training, the actor learns by regression what comes next in the clips, over a meta
    # policy in those that are new; only where training starts from a fresh policy
    warm_start: bool = False
    episode_s: float = number(10.0, above=0, most=3600)  # of every episode that does not fail
    # of every objective in the step that ends an episode early
    end_reward: float = number(-1.0, least=-1000, most=1000)
    # a joint centre below it, but for the feet's, is a fall
    fall_height_m: float = number(0.15, least=0, most=2)
    # times the range below, moved by an action of 1
    action_scale: float = number(1.0, above=0, most=100)
    # range: of a hinge, its whole range | clips: as much as the clips move it, and a little more
    action_range: str = "range"
    # pose of action 0; clips: of each hinge the mean over its group's clips | neutral
    action_centre: str = "clips"

    def __post_init__(self) -> None:
        check_numbers(self, "composite")
        for goal, settings in self.goals.items():
            for name, value in (settings or {}).items():
                for item in value if isinstance(value, list | tuple) else (value,):
                    check(item, float, _OF_GOALS, f"composite.goals.{goal}.{name}")
        require(bool(self.groups), "composite.groups", "at least one group", self.groups)
        twice = sorted(self.goals.keys() & self.groups.keys())
        require(not twice, "composite.groups", "names that no goal has", ", ".join(twice))
        kinds = ("all", "own")
        ok = self.meta_sees in kinds
        require(ok, "composite.meta_sees", f"one of {kinds}", self.meta_sees)
        centres, centre = ("clips", "neutral"), self.action_centre
        ok = centre in centres
        require(ok, "composite.action_centre", f"one of {centres}", centre)
        ranges = ("range", "clips")
        ok = self.action_range in ranges
        require(ok, "composite.action_range", f"one of {ranges}", self.action_range)
        start = self.start_group
        names = tuple(self.groups)
        ok = start is None or start in names
        require(ok, "composite.start_group", f"one of {names}, or null", start)
