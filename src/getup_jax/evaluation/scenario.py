"""What is harder than in training: other starts, durations and curves, and pushes."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from getup_jax.config import Config, ConfigError, MotionConfig
from getup_jax.config.load import load_config
from getup_jax.envs.getup.episode import LYING, STANDING
from getup_jax.envs.getup.resets.pool import Pool, angle_gap
from getup_jax.envs.getup.resets.rag_doll import DROPS
from getup_jax.envs.getup.resets.region_pool import region_starts
from getup_jax.evaluation.own_ground import OwnGround
from getup_jax.motion.clips import Clip, GetUp
from getup_jax.motion.getup import events
from getup_jax.motion.io.curve_file import CurveFile
from getup_jax.motion.io.readers import SUFFIXES
from getup_jax.motion.library import load_motions
from getup_jax.physics.character import CharacterSpec

# --drops: what the task's config says about the bodies that episodes begin with
DROPPED: dict[str, dict[str, Any]] = {
    **{name: {"drop_as": name} for name in DROPS},
    "fallen": {"fallen_share": 1.0},
}
PUSH_AFTER_S = 1.0  # a push comes at the first chance this long after the curve's end


@dataclasses.dataclass(frozen=True)
class Scenario:
    """How the episodes of one evaluation begin and what happens to them."""

    episodes: int | None = None  # None: 100, on irregular ground in each region; one a drawn curve
    start: str = "lying"  # lying | standing
    start_noise_rad: float = 0.0  # standard deviation on every hinge of the start poses
    duration_scale: tuple[float, float] = (1.0, 1.0)  # each episode's T is multiplied by U(a, b)
    blend: str | None = None  # half | random: mixtures of two curves; None: the curves themselves
    push_ns: float | None = None  # impulse to the chest while standing
    pushes_ns: tuple[float, ...] = ()  # several of them, each for all styles in turn; 0: no push
    edits: int = 0  # variants of each curve, run beside the episodes for the control gain
    seed: int = 0
    curves: tuple[str, ...] = ()  # curve files in place of the trained styles
    motions: str | None = None  # a config or motion file in place of the trained styles
    # how bodies came to lie, see DROPPED; None: as in training without limp_share
    drops: str | None = None
    stand_time_s: float | None = None  # to stand after the curve's end; None: as in training
    terrain_seed: int | None = None  # of the irregular ground; None: that of the training
    ground: OwnGround | None = None  # in place of the irregular ground of the training
    engine: str | None = None  # native | mjx; None: as in training
    # False: an episode that would end early goes on; `evaluation/verdicts.py` says that it did
    early_termination: bool = True

    @property
    def kind(self) -> int:
        """LYING or STANDING, see envs/getup/episode.py."""
        return STANDING if self.start == "standing" else LYING

    def check(self, config: Config) -> None:
        """Raise ConfigError for what cannot be evaluated under the config."""
        if self.drops is not None and self.kind == STANDING:
            raise ConfigError("--drops: says how bodies lie, but --start standing has none that do")
        if self.edits and self.kind == STANDING:
            raise ConfigError("--edits: are of the rise, so expected --start lying, got standing")
        stand_s = config.task.stand_time_s
        pushed = self.push_ns is not None or any(self.pushes_ns)
        if pushed and stand_s <= PUSH_AFTER_S:
            raise ConfigError(
                f"--push: comes {PUSH_AFTER_S:g} s after the curve's end, but the standing phase "
                f"lasts {stand_s:g} s; give a longer --stand-time"
            )

    def check_composite(self) -> None:
        """Raise ConfigError for what only means something for getting up."""
        given = {
            "--curves": bool(self.curves),
            "--motions": self.motions is not None,
            "--blend": self.blend is not None,
            "--push": self.push_ns is not None or bool(self.pushes_ns),
            "--drops": self.drops is not None,
            "--edits": self.edits > 0,
            "--start standing": self.start == "standing",
            "--start-noise": self.start_noise_rad > 0,
            "--duration-scale": self.duration_scale != (1.0, 1.0),
            "--stand-time": self.stand_time_s is not None,
            "--terrain-seed": self.terrain_seed is not None,
            "--ground": self.ground is not None,
        }
        wrong = [name for name, is_given in given.items() if is_given]
        if wrong:
            raise ConfigError(f"{', '.join(wrong)}: only for policies of the get-up task")


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """N episodes before they are run."""

    kind: int  # LYING or STANDING
    getup: np.ndarray  # [N] int32, the style
    row: np.ndarray  # [N] int32, row of the pool's table
    duration_scale: np.ndarray  # [N] float32
    impulse: np.ndarray  # [N, 3] Ns, zero: no push
    region: np.ndarray | None = None  # [N] int32 index into REGIONS; None: a flat plane
    points: np.ndarray | None = None  # [N, 9, 3] float32 control points; None: of the styles

    def on_regions(self, pool: Pool) -> Plan:
        """The same on irregular ground: its regions in turn, and the styles that start there."""
        getup, row, region = region_starts(pool, len(self.getup))
        return dataclasses.replace(self, getup=getup, row=row, region=region)


def make_plan(
    scenario: Scenario, episodes: int, num_styles: int, rows: int, regions: int = 1
) -> Plan:
    """The styles in turn, each with one start of the pool after the other.

    Where there are several pushes, all styles (in all regions) have one before the next one comes.
    """
    rng = np.random.default_rng(scenario.seed)
    number = np.arange(episodes)
    pushes = np.array(scenario.pushes_ns or (scenario.push_ns or 0.0,))
    push = pushes[number // (num_styles * regions) % len(pushes)]
    angle = rng.uniform(-np.pi, np.pi, episodes)
    direction = np.stack([np.cos(angle), np.sin(angle), np.zeros(episodes)], axis=-1)
    return Plan(
        kind=scenario.kind,
        getup=(number % num_styles).astype(np.int32),
        row=(number // num_styles % rows).astype(np.int32),
        duration_scale=rng.uniform(*scenario.duration_scale, episodes).astype(np.float32),
        impulse=push[:, None] * direction,
    )


def blended(
    getups: Sequence[GetUp], character: CharacterSpec, match_rad: float, scenario: Scenario
) -> tuple[GetUp, ...]:
    """Mixtures of every two curves that start alike, in random order.

    w a + (1 - w) b of the control points and of the durations, with w = 1/2 or U(0, 1). A
    mixture starts from the pose of one of the two motions, or of any where both are curves
    alone: the one whose torso angles are nearest to its first ones. Two curves start alike
    where these angles differ by at most match_rad, which also holds for pose and mixture.
    """
    rng = np.random.default_rng(scenario.seed)
    pairs = list(itertools.combinations(getups, 2))
    styles = []
    for i in rng.permutation(len(pairs)):
        first, second = pairs[i]
        weight = 0.5 if scenario.blend == "half" else float(rng.uniform())
        if np.abs(first.points[0, 1:] - second.points[0, 1:]).max() <= match_rad:
            mixed = _with_start(_mix(first, second, weight), (first, second), getups, character)
            if (
                mixed.clip is not None
                and angle_gap(mixed.clip.qpos[0], mixed, character) <= match_rad
            ):
                styles.append(mixed)
    if not styles:
        raise ConfigError(
            f"--blend: no two of the {len(getups)} curves start within task.curve_match_rad = "
            f"{match_rad:g} rad of each other; evaluate a policy of more curves"
        )
    return tuple(styles)


def _mix(first: GetUp, second: GetUp, weight: float) -> GetUp:
    def mean(a: Any, b: Any) -> Any:
        return weight * a + (1.0 - weight) * b

    return GetUp(
        name=f"{weight:.0%} {first.name} + {1.0 - weight:.0%} {second.name}",
        duration=mean(first.duration, second.duration),
        points=mean(first.points, second.points),
    )


def _with_start(
    mixed: GetUp, parents: Sequence[GetUp], getups: Sequence[GetUp], character: CharacterSpec
) -> GetUp:
    """The mixture with the motion that it starts like, if there is any motion."""
    own = [g.clip for g in parents if g.clip is not None]
    clips = own or [g.clip for g in getups if g.clip is not None]
    gaps = [angle_gap(clip.qpos[0], mixed, character) for clip in clips]
    return dataclasses.replace(mixed, clip=clips[int(np.argmin(gaps))]) if clips else mixed


def drawn(
    files: Sequence[CurveFile], getups: Sequence[GetUp], character: CharacterSpec
) -> tuple[GetUp, ...]:
    """The styles in curve files, each with the motion whose first pose it names as its start."""
    clips = reference_clips(getups)
    return tuple(
        getup for file in files for getup in file.getups(file.start_clip(clips, character))
    )


def of_config(path: str, getups: Sequence[GetUp], character: CharacterSpec) -> tuple[GetUp, ...]:
    """The get-ups of a config's `motion` section, or of a motion file, in place of `getups`."""
    is_motion = Path(path).suffix.lower() in (*SUFFIXES, ".npz")
    motion = MotionConfig(source=(path,)) if is_motion else load_config(path).motion
    found = load_motions(motion, character).getups
    if not found:
        raise ConfigError(f"--motions {path}: motion.source: no get-ups found")
    return found


def reference_clips(getups: Sequence[GetUp]) -> dict[str, Clip]:
    """The motions that a curve file may name as its start."""
    return {getup.name: getup.clip for getup in getups if getup.clip is not None}


def orientation(getup: GetUp) -> str:
    """supine, prone or side: how the curve starts, by its first front angle."""
    return events.orientation(float(np.cos(getup.points[0, 2])))
