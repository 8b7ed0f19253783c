"""Lying starts on irregular ground: a passive rag-doll falls and comes to rest [P 5.2].

Everything runs on the host with MuJoCo, so that all engines get the same starts.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from scipy.spatial.transform import Rotation

from getup_jax.config import ConfigError
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.settle import settle
from getup_jax.physics.surface import lift, link_gaps
from getup_jax.physics.terrain import HeightField
from getup_jax.physics.terrain_map import REGIONS, TerrainMap
from getup_jax.tasks.set_down import to_normal

DAMPING = 5.0  # Nms/rad of every hinge of the rag-doll; its servos are off
_POSE_NOISE_RAD = 0.35
_GAP_M = 0.05  # it is dropped from this height
_FALL_S, _MOST_FALLS = 1.5, 4  # it falls for this long, again and again while it moves
_ROUNDS = 10  # of drops, until enough came to rest
_HOLD_S = 0.5  # under its own servos, as the task has it
_STILL = 0.3  # rad/s and m/s: slower is at rest
_SUNK_M, _FLOAT_M = -0.02, 0.01  # gaps to the ground that no start may pass
_PRONE, _SUPINE = 0.4, 0.4  # shares; the others fall on a side


@dataclasses.dataclass(frozen=True)
class Starts:
    """N states of the character on irregular ground."""

    qpos: np.ndarray  # [N, 7 + J]
    qvel: np.ndarray  # [N, 6 + J]
    region: np.ndarray  # [N] index into REGIONS


def fall(
    character: CharacterSpec,
    ground: TerrainMap,
    count: int,
    seed: int,
    log: Callable[[str], None],
) -> Starts:
    """`count` rag-dolls at rest, equally many in every irregular region.

    character: with the ground in its model. Falls that slide out of their region, or that do not
    come to rest, are dropped again elsewhere.
    """
    rng = np.random.default_rng(seed)
    field = ground.field()
    wanted = np.bincount(1 + np.arange(count) % (len(REGIONS) - 1), minlength=len(REGIONS))
    kept: list[Starts] = []
    missing = wanted
    for _ in range(_ROUNDS):
        region = np.repeat(np.arange(len(REGIONS)), np.ceil(1.15 * missing).astype(int))
        kept.append(_drop(character, ground, field, region, rng))
        log(f"lying starts: {len(kept[-1].region)} of {len(region)} rag-dolls came to rest")
        found = np.concatenate([starts.region for starts in kept])
        missing = np.maximum(wanted - np.bincount(found, minlength=len(REGIONS)), 0)
        if not missing.any():
            return _first(kept, wanted)
    raise ConfigError(
        f"terrain: rag-dolls do not come to rest in the region {REGIONS[int(missing.argmax())]!r}; "
        "make terrain.slope_deg or terrain.rough_m smaller"
    )


def _drop(
    character: CharacterSpec,
    ground: TerrainMap,
    field: HeightField,
    region: np.ndarray,
    rng: np.random.Generator,
) -> Starts:
    """One fall a row of region [N]; those that make a fair start."""
    xy = np.zeros((len(region), 2))
    for index in np.unique(region):
        xy[region == index] = ground.draw_spawn(int(index), int((region == index).sum()), rng)
    qpos = _postures(character, xy, field.normal(xy), rng)
    qpos = _come_to_rest(character, lift(character, field, qpos, _GAP_M))
    qpos, qvel = settle(character, qpos, _HOLD_S)
    ok = (ground.region(qpos[:, :2]) == region) & (np.abs(qvel).max(axis=1) < _STILL)
    ok &= is_on_ground(character, field, qpos)
    return Starts(qpos[ok], qvel[ok], region[ok])


def is_on_ground(character: CharacterSpec, field: HeightField, qpos: np.ndarray) -> np.ndarray:
    """Whether poses qpos [N, 7 + J] lie or stand on the ground, [N]: no link sunk, not floating."""
    gap = link_gaps(character, field, qpos).min(axis=1)
    return (gap > _SUNK_M) & (gap < _FLOAT_M)


def _postures(
    character: CharacterSpec, xy: np.ndarray, normal: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Limp poses [N, 7 + J], prone, supine or on a side along the slope, with any heading."""
    size = len(xy)
    qpos = np.tile(character.neutral_qpos, (size, 1))
    limp = qpos[:, 7:] + _POSE_NOISE_RAD * rng.standard_normal(qpos[:, 7:].shape)
    qpos[:, 7:] = np.clip(limp, character.joint_lower, character.joint_upper)
    draw = rng.uniform(size=size)
    # turned about the body's long axis: 0 on the face, pi on the back, half on a side
    side = rng.choice([-0.5, 0.5], size=size) * np.pi
    roll = np.where(draw < _PRONE, 0.0, np.where(draw < _PRONE + _SUPINE, np.pi, side))
    vertical = np.array([[0.0, 0.0, 1.0]])
    lying = Rotation.from_rotvec([0.0, np.pi / 2, 0.0])
    lying = lying * Rotation.from_rotvec(roll[:, None] * vertical)
    heading = Rotation.from_rotvec(rng.uniform(-np.pi, np.pi, (size, 1)) * vertical)
    turn = to_normal(normal) * heading * lying
    qpos[:, :2], qpos[:, 3:7] = xy, turn.as_quat(scalar_first=True)
    return qpos


def _come_to_rest(character: CharacterSpec, qpos: np.ndarray) -> np.ndarray:
    """Poses [N, 7 + J] after a passive fall; NaN where the simulation failed."""
    model = copy.copy(character.model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    model.dof_damping[6:] = DAMPING
    qpos, moving = qpos.copy(), np.arange(len(qpos))
    velocity = np.zeros((len(qpos), model.nv))
    for _ in range(_MOST_FALLS):
        batch = Batch(model, len(moving))
        batch.qpos[:], batch.qvel[:] = qpos[moving], velocity[moving]
        try:
            batch.step(nstep=round(_FALL_S / model.opt.timestep))
        except SimulationError as error:
            batch.qpos[error.ids] = np.nan
        qpos[moving], velocity[moving] = batch.qpos, batch.qvel
        moving = moving[np.abs(velocity[moving]).max(axis=1) > _STILL]
        if not len(moving):
            break
    return qpos


def _first(kept: list[Starts], wanted: np.ndarray) -> Starts:
    """The first `wanted` [R] starts of every region."""
    qpos, qvel, region = (
        np.concatenate([getattr(s, name) for s in kept]) for name in ("qpos", "qvel", "region")
    )
    index = np.concatenate(
        [np.flatnonzero(region == i)[:number] for i, number in enumerate(wanted)]
    )
    return Starts(qpos[index], qvel[index], region[index])
