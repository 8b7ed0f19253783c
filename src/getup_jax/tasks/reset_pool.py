"""Start states, made once: settled lying poses, standing, and poses along the reference clips."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct

from getup_jax.config import ConfigError, TaskConfig
from getup_jax.motion.clips import GetUp
from getup_jax.motion.features import FeatureLinks, features
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.settle import lift_to_ground, settle
from getup_jax.tasks.clip_starts import ClipFrames, velocities
from getup_jax.tasks.episode import CLIP, LYING, STANDING
from getup_jax.types import Engine, PhysicsState

_DROP_M = 0.01  # lying poses are dropped from this height
_SINK_M = 0.001  # the others touch the ground, as a body at rest does

_Start = tuple[np.ndarray, np.ndarray, np.ndarray]


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
    startable: Startable | None = None  # None, a flat plane: every style can start everywhere


def build_pool(
    getups: Sequence[GetUp], character: CharacterSpec, engine: Engine, config: TaskConfig, seed: int
) -> Pool:
    """Make the start states of all kinds that the config asks for.

    A kind with no share still gets one row a style, so that the table has one form.
    """
    kinds = sum(share > 0 for share in kind_shares(config))
    rows = max(1, config.pool_size // max(1, len(getups) * kinds))
    qpos, qvel, time, table = FlatStarts(getups, character, config, seed).make(rows)
    lying = np.unique(table[LYING])
    qpos[lying], qvel[lying] = settle(character, qpos[lying], config.settle_s)
    physics = engine.place(qpos, qvel)
    check_finite(physics, qpos)
    return Pool(
        physics=physics,
        time=jnp.asarray(time, jnp.float32),
        table=jnp.asarray(table[:, None]),
    )


@dataclasses.dataclass(frozen=True, eq=False)
class FlatStarts:
    """Start states on the flat plane, not settled yet."""

    getups: Sequence[GetUp]
    character: CharacterSpec
    config: TaskConfig
    seed: int

    def make(self, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """qpos [P, 7 + J], qvel [P, 6 + J], time [P] and the table [3, G, rows] of their rows.

        Lying starts hang just above the ground; the caller lets them settle.
        """
        counts = [rows if share > 0 else 1 for share in kind_shares(self.config)]
        poses = [g.clip.qpos[0] for g in self.getups if g.clip is not None]
        rng = np.random.default_rng(self.seed)
        frames = None
        if self.config.clip_start > 0:
            frames = ClipFrames.of(self.getups, self.character)
        make = _StartMaker(self.character, self.config, rng, poses, frames)
        starts, table, offset = [], np.zeros((3, len(self.getups), rows), np.int32), 0
        for kind, count in enumerate(counts):
            for index, getup in enumerate(self.getups):
                starts.append(make.start(kind, getup, count))
                table[kind, index] = offset + np.arange(rows) % count
                offset += count
        qpos, qvel, time = (np.concatenate(part) for part in zip(*starts, strict=True))
        lying = np.unique(table[LYING])
        standing = np.arange(len(lying), len(qpos))
        qpos[lying] = lift_to_ground(self.character, qpos[lying], _DROP_M)
        qpos[standing] = lift_to_ground(self.character, qpos[standing], -_SINK_M)
        return qpos, qvel, time, table


def kind_shares(config: TaskConfig) -> tuple[float, float, float]:
    """Shares of the kinds LYING, STANDING and CLIP, in this order; they sum to 1."""
    lying = 1.0 - config.stand_start - config.clip_start
    return lying, config.stand_start, config.clip_start


@dataclasses.dataclass(frozen=True)
class _StartMaker:
    """Makes qpos [n, 7 + J], qvel [n, 6 + J] and time [n] of n start states of one style."""

    character: CharacterSpec
    config: TaskConfig
    rng: np.random.Generator
    lying_poses: list[np.ndarray]  # first poses of all reference motions
    frames: ClipFrames | None  # of all reference motions, where starts along them are asked for

    def start(self, kind: int, getup: GetUp, count: int) -> _Start:
        if kind == STANDING:
            qpos = self._noisy(np.tile(self.character.neutral_qpos, (count, 1)))
            return qpos, self._at_rest(qpos), np.full(count, getup.duration)
        along = self._along(getup, count) if kind == CLIP else None
        if along is not None:
            return along
        fitting = self._fitting(getup)
        qpos = self._noisy(
            np.stack([fitting[i] for i in self.rng.integers(len(fitting), size=count)])
        )
        return qpos, self._at_rest(qpos), np.zeros(count)

    def _along(self, getup: GetUp, count: int) -> _Start | None:
        """Random frames of the get-up's motion, or for a curve alone frames that look like it."""
        if getup.clip is None:
            return self.frames and self.frames.along(getup, count, self.rng)
        frame = self.rng.integers(0, len(getup.clip.qpos) - 1, size=count)
        qvel = velocities(getup.clip, self.character)[frame]
        return getup.clip.qpos[frame], qvel, frame / getup.clip.fps

    def _fitting(self, getup: GetUp) -> list[np.ndarray]:
        """Lying poses whose torso angles are near the curve's first ones [P 5.2]."""
        poses = self.lying_poses if getup.clip is None else [getup.clip.qpos[0]]
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

    def _at_rest(self, qpos: np.ndarray) -> np.ndarray:
        return np.zeros((len(qpos), self.character.model.nv))

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
    value = np.asarray(features(FeatureLinks.of(character), jnp.asarray(data.xpos[1:]), 0.0))
    return float(np.abs(value[1:] - getup.points[0, 1:]).max())


def check_finite(physics: PhysicsState, qpos: np.ndarray) -> None:
    """Raise ConfigError if the engine cannot have the start states qpos [P, 7 + J]."""
    finite = np.asarray(physics.kinematics.finite)
    if not finite.all():
        raise ConfigError(
            f"{(~finite).sum()} of {len(qpos)} start states are not finite; the character or the "
            "physics settings are unstable"
        )
