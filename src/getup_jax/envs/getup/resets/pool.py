"""Start states, made once: settled lying poses, standing, and states along the way between them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct

from getup_jax.config import ConfigError, CurriculumConfig, TaskConfig
from getup_jax.core.types import Engine, PhysicsState
from getup_jax.envs.getup.episode import CLIP, LYING, STANDING
from getup_jax.envs.getup.references import Reference, make_references, velocities
from getup_jax.envs.getup.resets.archived_states import FoundPath, load_paths
from getup_jax.envs.getup.resets.lying import Log, Starts
from getup_jax.envs.getup.resets.style_matching import fits, least_used
from getup_jax.motion.clips import GetUp
from getup_jax.motion.getup.curves import FeatureLinks, features
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.settle import lift_to_ground, settle
from getup_jax.physics.surface import TOUCH_M

_DROP_M = 0.01  # lying poses are dropped from this height
_NEAR_S = 0.1  # a found state stands for the curve's times that are this close


@dataclasses.dataclass
class FreeStarts:
    """P start states that no engine has seen yet."""

    qpos: np.ndarray  # [P, 7 + J]
    qvel: np.ndarray  # [P, 6 + J]
    time: np.ndarray  # [P] s since the curve's start
    action: np.ndarray  # [P, A] filtered; NaN: what asks for the start's own pose

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def join(cls, parts: Sequence[FreeStarts]) -> FreeStarts:
        """All of them in one, in their order."""
        fields = [f.name for f in dataclasses.fields(cls)]
        return cls(**{f: np.concatenate([getattr(part, f) for part in parts]) for f in fields})


@struct.dataclass
class Startable:
    """The styles that have lying starts in each region of irregular ground."""

    styles: jax.Array  # [R, G] int32, first those that can start there, then the others
    count: jax.Array  # [R] int32, how many can


@struct.dataclass
class Pool:
    """P start states and which of them belong to which style."""

    physics: PhysicsState  # [P] rows
    time: jax.Array  # [P] s since the curve's start, for a duration of 1 x T
    table: jax.Array  # [3, R, G, M] int32 rows of every kind of start, region and style
    action: jax.Array | None = None  # [P, A] filtered, NaN: the pose's own; None: all are
    startable: Startable | None = None  # None, a flat plane: every style can start everywhere


def build_pool(flat: FlatStarts, engine: Engine, log: Log) -> Pool:
    """Make the start states of all kinds that the config asks for, on the flat plane.

    A kind with no share still gets one row a style, so that the table has one form.
    """
    kinds = sum(share > 0 for share in kind_shares(flat.config, flat.curriculum))
    rows = max(1, flat.config.pool_size // max(1, len(flat.getups) * kinds))
    starts, table = flat.make(rows)
    flat.lay_down(starts, table[LYING], flat.character, log)
    physics = engine.place(starts.qpos, starts.qvel)
    check_finite(physics, starts.qpos)
    return Pool(
        physics=physics,
        time=jnp.asarray(starts.time, jnp.float32),
        table=jnp.asarray(table[:, None]),
        action=given_actions(starts),
    )


def given_actions(starts: FreeStarts) -> jax.Array | None:
    """The pool's `action`."""
    given = ~np.isnan(starts.action)
    return jnp.asarray(starts.action, jnp.float32) if given.any() else None


@dataclasses.dataclass(frozen=True, eq=False)
class FlatStarts:
    """Start states on the flat plane, not settled yet."""

    getups: Sequence[GetUp]
    character: CharacterSpec
    config: TaskConfig
    curriculum: CurriculumConfig
    seed: int
    action_size: int
    limp: Starts | None = None  # limp bodies on flat ground; None: no lying start is one

    def make(self, rows: int) -> tuple[FreeStarts, np.ndarray]:
        """P start states and the table [3, G, rows] of their rows.

        Lying starts hang just above the ground, see `lay_down`.
        """
        counts = [rows if share > 0 else 1 for share in kind_shares(self.config, self.curriculum)]
        make = self._maker()
        parts, table, offset = [], np.zeros((3, len(self.getups), rows), np.int32), 0
        for kind, count in enumerate(counts):
            for style in range(len(self.getups)):
                parts.append(make.start(kind, style, count))
                table[kind, style] = offset + np.arange(rows) % count
                offset += count
        starts = FreeStarts.join(parts)
        lying = np.unique(table[LYING])
        free = np.asarray(np.isnan(starts.action).all(axis=1))
        free[lying] = False
        qpos = starts.qpos
        qpos[lying] = lift_to_ground(self.character, qpos[lying], _DROP_M)
        qpos[free] = lift_to_ground(self.character, qpos[free], -TOUCH_M)
        return starts, table

    def lay_down(
        self, starts: FreeStarts, table: np.ndarray, character: CharacterSpec, log: Log
    ) -> None:
        """Let the lying starts of the rows in the table [G, rows] settle, in place.

        character: on the ground where they are. The config's share of them is replaced by limp
        bodies that fit the style; a style that none fits keeps its own poses.
        """
        lying = np.unique(table)
        starts.qpos[lying], starts.qvel[lying] = settle(
            character, starts.qpos[lying], self.config.settle_s
        )
        if self.limp is None:
            return
        fair = fits(self.getups, self.limp.qpos, character, self.config.curve_match_rad)
        count = round(self.config.limp_share * table.shape[1])
        used, rng = np.zeros(len(fair), int), np.random.default_rng((self.seed, count))
        some = np.asarray(fair.any(axis=0))
        for style in np.flatnonzero(some):
            body = least_used(fair[:, style], used, count, rng)
            replaced = table[style, :count]
            starts.qpos[replaced], starts.qvel[replaced] = (
                self.limp.qpos[body],
                self.limp.qvel[body],
            )
        own = [g.name for g, ok in zip(self.getups, some, strict=True) if not ok]
        if own:
            log(f"start states: no limp body on flat ground fits {', '.join(own)}")

    def _maker(self) -> _StartMaker:
        getups, character, config = self.getups, self.character, self.config
        references: Sequence[Reference | None] = [None] * len(getups)
        paths: Sequence[FoundPath | None] = [None] * len(getups)
        if self.curriculum.reference_start > 0:
            references = make_references(getups, character)
            if self.curriculum.archive is not None:
                size = character.num_joints, self.action_size
                paths = load_paths(self.curriculum.archive, getups, *size)
        return _StartMaker(
            getups=getups,
            character=character,
            config=config,
            rng=np.random.default_rng(self.seed),
            references=references,
            paths=paths,
            path_share=self.curriculum.archive_share,
            action_size=self.action_size,
        )


def kind_shares(config: TaskConfig, curriculum: CurriculumConfig) -> tuple[float, float, float]:
    """Shares of the kinds LYING, STANDING and CLIP, in this order; they sum to 1."""
    lying = 1.0 - config.stand_start - curriculum.reference_start
    return lying, config.stand_start, curriculum.reference_start


@dataclasses.dataclass(frozen=True)
class _StartMaker:
    """Makes start states of one kind and style."""

    getups: Sequence[GetUp]
    character: CharacterSpec
    config: TaskConfig
    rng: np.random.Generator
    references: Sequence[Reference | None]  # [G]
    paths: Sequence[FoundPath | None]  # [G]
    path_share: float  # of the starts along the motion that a path's state replaces
    action_size: int

    def start(self, kind: int, style: int, count: int) -> FreeStarts:
        getup, reference = self.getups[style], self.references[style]
        if kind == STANDING:
            neutral = np.tile(self.character.neutral_qpos, (count, 1))
            return self._at_rest(self._noisy(neutral), getup.duration)
        if kind == CLIP and reference is not None and len(reference.starts):
            return self._found(self._along(reference, count), self.paths[style])
        fitting = self._fitting(getup)
        chosen = self.rng.integers(len(fitting), size=count)
        return self._at_rest(self._noisy(np.stack([fitting[i] for i in chosen])), 0.0)

    def _along(self, reference: Reference, count: int) -> FreeStarts:
        """Random frames of the motion."""
        frame = self.rng.choice(reference.starts, size=count)
        qvel = velocities(reference.clip, self.character)[frame]
        time = frame / reference.clip.fps
        return FreeStarts(reference.clip.qpos[frame], qvel, time, self._no_action(count))

    def _found(self, starts: FreeStarts, path: FoundPath | None) -> FreeStarts:
        """The starts, with those replaced that a found state is near to in time."""
        if path is None:
            return starts
        for row, time in enumerate(starts.time):
            near = path.near(time, _NEAR_S)
            if len(near) and self.rng.random() < self.path_share:
                chosen = self.rng.choice(near)
                for field in dataclasses.fields(starts):
                    getattr(starts, field.name)[row] = getattr(path, field.name)[chosen]
        return starts

    def _fitting(self, getup: GetUp) -> list[np.ndarray]:
        """Lying poses whose torso angles are near the curve's first ones [P 5.2]."""
        clips = [g.clip for g in (self.getups if getup.clip is None else [getup])]
        poses = [clip.qpos[0] for clip in clips if clip is not None]
        gaps = [angle_gap(pose, getup, self.character) for pose in poses]
        limit = self.config.curve_match_rad
        fitting = [pose for pose, gap in zip(poses, gaps, strict=True) if gap <= limit]
        if not fitting:
            raise ConfigError(
                f"get-up {getup.name!r}: its first torso angles are "
                f"{min(gaps, default=np.nan):.2f} rad from the nearest lying pose, more than "
                f"task.curve_match_rad = {limit}; leave it out of motion.curves or add a motion "
                "that starts like it"
            )
        return fitting

    def _at_rest(self, qpos: np.ndarray, time: float) -> FreeStarts:
        count = len(qpos)
        qvel = np.zeros((count, self.character.model.nv))
        return FreeStarts(qpos, qvel, np.full(count, time), self._no_action(count))

    def _no_action(self, count: int) -> np.ndarray:
        return np.full((count, self.action_size), np.nan)

    def _noisy(self, qpos: np.ndarray) -> np.ndarray:
        """Joint noise within the limits, and any heading."""
        qpos, character, noise = qpos.copy(), self.character, self.config.start_noise_rad
        joints = qpos[:, 7:] + noise * self.rng.standard_normal(qpos[:, 7:].shape)
        qpos[:, 7:] = np.clip(joints, character.joint_lower, character.joint_upper)
        for row, yaw in zip(qpos, self.rng.uniform(-np.pi, np.pi, len(qpos)), strict=True):
            turn = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
            mujoco.mju_mulQuat(row[3:7], turn, row[3:7].copy())
        return qpos


def angle_gap(qpos: np.ndarray, getup: GetUp, character: CharacterSpec) -> float:
    """Largest difference between a pose's torso angles and the curve's first ones (rad)."""
    data = mujoco.MjData(character.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(character.model, data)
    value = features(FeatureLinks.of(character), data.xpos[1:], 0.0)
    return float(np.abs(value[1:] - getup.points[0, 1:]).max())


def check_finite(physics: PhysicsState, qpos: np.ndarray) -> None:
    """Raise ConfigError if the engine cannot have the start states qpos [P, 7 + J]."""
    finite = np.asarray(physics.kinematics.finite)
    if not finite.all():
        raise ConfigError(
            f"{(~finite).sum()} of {len(qpos)} start states are not finite; the character or the "
            "physics settings are unstable"
        )
