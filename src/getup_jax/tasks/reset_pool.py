"""Start states, made once: settled lying poses, standing, and poses along the reference clips."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct

from getup_jax.config import ConfigError, TaskConfig
from getup_jax.motion.clips import GetUp
from getup_jax.motion.features import FeatureLinks, features
from getup_jax.physics.character import CharacterSpec
from getup_jax.tasks.episode import CLIP, LYING, STANDING
from getup_jax.types import Engine, PhysicsState, take

_SETTLE_LIFT_M = 0.01  # poses are dropped from this height


@struct.dataclass
class Pool:
    """P start states and which of them belong to which style."""

    physics: PhysicsState  # [P] rows
    time: jax.Array  # [P] s since the curve's start, for a duration of 1 x T
    table: jax.Array  # [3, G, M] int32 rows of every kind of start and style


def build_pool(
    getups: Sequence[GetUp], character: CharacterSpec, engine: Engine, config: TaskConfig, seed: int
) -> Pool:
    """Make the start states of all kinds that the config asks for.

    A kind with no share still gets one row a style, so that the table has one form.
    """
    rng = np.random.default_rng(seed)
    shares = _shares(config)
    rows = max(1, config.pool_size // max(1, len(getups) * sum(s > 0 for s in shares)))
    counts = [rows if share > 0 else 1 for share in shares]
    makers = (_lying_rows, _standing_rows, _clip_rows)
    starts, table, offset = [], np.zeros((3, len(getups), rows), np.int32), 0
    first_poses = lying_poses(getups)
    for kind, (make, count) in enumerate(zip(makers, counts, strict=True)):
        for index, getup in enumerate(getups):
            starts.append(make(getup, count, character, config, rng, first_poses))
            table[kind, index] = offset + np.arange(rows) % count
            offset += count
    qpos, qvel, time = (np.concatenate(part) for part in zip(*starts, strict=True))
    lying = np.repeat([True, False, False], [len(getups) * count for count in counts])
    physics = _settle(engine, character, qpos, qvel, lying, config.settle_s)
    _check_finite(physics, qpos)
    return Pool(
        physics=physics, time=jnp.asarray(time, jnp.float32), table=jnp.asarray(table)
    )


def lying_poses(getups: Sequence[GetUp]) -> list[np.ndarray]:
    """First pose of every reference motion."""
    return [g.clip.qpos[0] for g in getups if g.clip is not None]


def _shares(config: TaskConfig) -> tuple[float, float, float]:
    """Shares of the kinds LYING, STANDING, CLIP; they sum to 1."""
    lying = 1.0 - config.stand_start - config.clip_start
    shares = {LYING: lying, STANDING: config.stand_start, CLIP: config.clip_start}
    return tuple(shares[kind] for kind in (LYING, STANDING, CLIP))  # type: ignore[return-value]


def _lying_rows(getup, count, character, config, rng, first_poses):  # noqa: ANN001, ANN202
    poses = [getup.clip.qpos[0]] if getup.clip is not None else first_poses
    fitting = [p for p in poses if _angle_gap(p, getup, character) <= config.curve_match_rad]
    if not fitting:
        gap = min((_angle_gap(p, getup, character) for p in poses), default=float("nan"))
        raise ConfigError(
            f"get-up {getup.name!r}: its first torso angles are {gap:.2f} rad from the nearest lying "
            f"pose, more than task.curve_match_rad = {config.curve_match_rad}; leave it out of "
            "motion.curves or add a motion that starts like it"
        )
    pick = rng.integers(len(fitting), size=count)
    qpos = np.stack([fitting[i] for i in pick])
    qpos = _noisy(qpos, config.start_noise_rad, character, rng)
    return qpos, np.zeros((count, qpos.shape[1] - 1)), np.zeros(count)


def _standing_rows(getup, count, character, config, rng, _):  # noqa: ANN001, ANN202
    qpos = np.tile(character.neutral_qpos, (count, 1))
    qpos = _noisy(qpos, config.start_noise_rad, character, rng)
    return qpos, np.zeros((count, qpos.shape[1] - 1)), np.full(count, getup.duration)


def _clip_rows(getup, count, character, config, rng, first_poses):  # noqa: ANN001, ANN202
    clip = getup.clip
    if clip is None:  # a curve alone has no poses on the way: it starts lying
        return _lying_rows(getup, count, character, config, rng, first_poses)
    frame = rng.integers(0, len(clip.qpos) - 1, size=count)
    qpos, qvel = clip.qpos[frame], np.zeros((count, character.model.nv))
    for i, f in enumerate(frame):
        mujoco.mj_differentiatePos(
            character.model, qvel[i], 1.0 / clip.fps, clip.qpos[f], clip.qpos[f + 1]
        )
    return qpos, qvel, frame / clip.fps


def _noisy(
    qpos: np.ndarray, noise_rad: float, character: CharacterSpec, rng: np.random.Generator
) -> np.ndarray:
    """Joint noise within the limits, and any heading."""
    qpos = qpos.copy()
    joints = qpos[:, 7:] + rng.normal(0.0, 1.0, qpos[:, 7:].shape) * noise_rad
    qpos[:, 7:] = np.clip(joints, character.joint_lower, character.joint_upper)
    if noise_rad > 0:
        for row in qpos:
            yaw = rng.uniform(-np.pi, np.pi)
            turn = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
            mujoco.mju_mulQuat(row[3:7], turn, row[3:7].copy())
    return qpos


def _angle_gap(qpos: np.ndarray, getup: GetUp, character: CharacterSpec) -> float:
    """Largest difference between a pose's torso angles and the curve's first ones (rad)."""
    data = mujoco.MjData(character.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(character.model, data)
    value = np.asarray(features(FeatureLinks.of(character), jnp.asarray(data.xpos[1:]), 0.0))
    return float(np.abs(value[1:] - getup.points[0, 1:]).max())


def lift_to_ground(character: CharacterSpec, qpos: np.ndarray, gap_m: float) -> np.ndarray:
    """Poses [P, 7 + J] moved up or down until their lowest point is gap_m above z = 0."""
    model, data, qpos = character.model, mujoco.MjData(character.model), qpos.copy()
    floor = [i for i in range(model.ngeom) if model.geom_bodyid[i] == 0]
    body = [i for i in range(model.ngeom) if model.geom_bodyid[i] > 0 and model.geom_contype[i]]
    for row in qpos:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        far = 10.0
        lowest = min(mujoco.mj_geomDistance(model, data, floor[0], g, far, None) for g in body)
        row[2] += gap_m - lowest
    return qpos


def _settle(
    engine: Engine,
    character: CharacterSpec,
    qpos: np.ndarray,
    qvel: np.ndarray,
    lying: np.ndarray,
    seconds: float,
) -> PhysicsState:
    """Let the lying rows come to rest under their own servos; the others stay as they are."""
    qpos = qpos.copy()
    qpos[lying] = lift_to_ground(character, qpos[lying], _SETTLE_LIFT_M)
    qpos[~lying] = lift_to_ground(character, qpos[~lying], -0.001)
    state = engine.place(qpos, qvel)
    steps = round(seconds / engine.control_dt)
    if steps == 0:
        return state
    step: Callable[[PhysicsState, jax.Array], PhysicsState] = jax.jit(engine.step)
    rested = state
    for _ in range(steps):
        rested = step(rested, jnp.asarray(qpos[:, 7:], jnp.float32))
    keep = jnp.asarray(lying) & rested.kinematics.finite
    order = jnp.where(keep, jnp.arange(len(qpos)), jnp.arange(len(qpos)) + len(qpos))
    both = jax.tree.map(lambda a, b: jnp.concatenate([a, b]), rested, state)
    return take(both, order)


def _check_finite(physics: PhysicsState, qpos: np.ndarray) -> None:
    finite = np.asarray(physics.kinematics.finite)
    if not finite.all():
        raise ConfigError(
            f"{(~finite).sum()} of {len(qpos)} start states are not finite; the character or the "
            "physics settings are unstable"
        )
