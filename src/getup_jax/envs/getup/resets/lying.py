"""States that lie on the ground: bodies that fell and came to rest, at places of every region.

Everything runs on the host with MuJoCo, so that all engines get the same starts.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable
from typing import Protocol

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from getup_jax.config import ConfigError
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.settle import settle
from getup_jax.physics.surface import link_gaps
from getup_jax.physics.terrain import HeightField
from getup_jax.physics.terrain_map import REGIONS

DAMPING = 5.0  # Nms/rad of every hinge of a body that falls
_FALL_S, _MOST_FALLS = 1.5, 4  # it falls for this long, again and again while it moves
_ROUNDS = 10  # of falls, until enough came to rest
_HOLD_S = 0.5  # under its own servos, as the task has it
_STILL = 0.3  # rad/s and m/s: slower is at rest
_SUNK_M, _FLOAT_M = -0.02, 0.01  # gaps to the ground that no start may pass

Log = Callable[[str], None]


class Place(Protocol):
    """Where bodies fall: irregular ground or the plane."""

    def field(self) -> HeightField:
        """The ground's heights, in NumPy."""
        ...

    def region(self, xy: np.ndarray) -> np.ndarray:
        """Index into REGIONS of places xy [..., 2] (m)."""
        ...

    def draw_spawn(self, region: int, count: int, rng: np.random.Generator) -> np.ndarray:
        """Random places [count, 2] (m) of a region where bodies may start."""
        ...


@dataclasses.dataclass(frozen=True)
class Starts:
    """N states of the character on the ground."""

    qpos: np.ndarray  # [N, 7 + J]
    qvel: np.ndarray  # [N, 6 + J]
    region: np.ndarray  # [N] index into REGIONS

    @classmethod
    def none(cls, character: CharacterSpec) -> Starts:
        """No states of the character."""
        nq, nv = character.model.nq, character.model.nv
        return cls(np.zeros((0, nq)), np.zeros((0, nv)), np.zeros(0, int))

    @classmethod
    def join(cls, parts: list[Starts]) -> Starts:
        """All of them in one, in their order."""
        fields = [f.name for f in dataclasses.fields(cls)]
        return cls(**{f: np.concatenate([getattr(part, f) for part in parts]) for f in fields})

    def take(self, index: np.ndarray) -> Starts:
        """Those of the given rows."""
        return Starts(self.qpos[index], self.qvel[index], self.region[index])


def until_enough(wanted: np.ndarray, make: Callable[[np.ndarray], Starts], problem: str) -> Starts:
    """The first wanted [R] starts of every region, out of those that make(regions [N]) finds fair.

    Raises ConfigError with the problem where a region has too few after several rounds.
    """
    kept: list[Starts] = []
    missing = wanted
    for _ in range(_ROUNDS):
        kept.append(make(np.repeat(np.arange(len(wanted)), np.ceil(1.15 * missing).astype(int))))
        region = np.concatenate([starts.region for starts in kept])
        missing = np.maximum(wanted - np.bincount(region, minlength=len(wanted)), 0)
        if not missing.any():
            first = [np.flatnonzero(region == i)[:number] for i, number in enumerate(wanted)]
            return Starts.join(kept).take(np.concatenate(first))
    where = REGIONS[int(missing.argmax())]
    if where == REGIONS[0]:
        raise ConfigError(f"task.limp_share: {problem} on flat ground; see the physics settings")
    raise ConfigError(
        f"terrain: {problem} in the region {where!r}; "
        "make terrain.slope_deg, rough_m or height_m smaller"
    )


def spawn(place: Place, region: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Random places [N, 2] (m) in the regions [N]."""
    xy = np.zeros((len(region), 2))
    for index in np.unique(region):
        xy[region == index] = place.draw_spawn(int(index), int((region == index).sum()), rng)
    return xy


def fair_starts(
    character: CharacterSpec, place: Place, qpos: np.ndarray, region: np.ndarray
) -> Starts:
    """Those of the poses [N, 7 + J] that lie still in their regions [N] under their own servos."""
    qpos, qvel = settle(character, qpos, _HOLD_S)
    ok = (place.region(qpos[:, :2]) == region) & (np.abs(qvel).max(axis=1) < _STILL)
    ok &= is_on_ground(character, place.field(), qpos)
    return Starts(qpos[ok], qvel[ok], region[ok])


def is_on_ground(character: CharacterSpec, field: HeightField, qpos: np.ndarray) -> np.ndarray:
    """Whether poses qpos [N, 7 + J] lie or stand on the ground, [N]: no link sunk, not floating."""
    gap = link_gaps(character, field, qpos).min(axis=1)
    return (gap > _SUNK_M) & (gap < _FLOAT_M)


def come_to_rest(
    character: CharacterSpec,
    qpos: np.ndarray,
    strength: float,
    qvel: np.ndarray | None = None,
    target: np.ndarray | None = None,
) -> np.ndarray:
    """Poses [N, 7 + J] after a fall from qpos and qvel, None: at rest; NaN where it failed.

    Servos with a share `strength` of their torque limits (0: they are off) hold the hinges at
    target [N, J] meanwhile; None: at those of qpos.
    """
    model = falling_model(character, strength)
    target = qpos[:, 7:].copy() if target is None else target
    velocity = np.zeros((len(qpos), model.nv)) if qvel is None else qvel.copy()
    qpos, moving = qpos.copy(), np.arange(len(qpos))
    for _ in range(_MOST_FALLS):
        batch = Batch(model, len(moving))
        batch.qpos[:], batch.qvel[:] = qpos[moving], velocity[moving]
        batch.ctrl[:] = target[moving]
        try:
            batch.step(nstep=round(_FALL_S / model.opt.timestep))
        except SimulationError as error:
            batch.qpos[error.ids] = np.nan
        qpos[moving], velocity[moving] = batch.qpos, batch.qvel
        moving = moving[np.abs(velocity[moving]).max(axis=1) > _STILL]
        if not len(moving):
            break
    return qpos


def falling_model(character: CharacterSpec, strength: float) -> mujoco.MjModel:
    """The character's model with weak servos, or none, and hinges that damp."""
    model = copy.copy(character.model)
    if strength == 0:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    model.actuator_forcerange *= strength
    model.dof_damping[6:] = DAMPING
    return model
