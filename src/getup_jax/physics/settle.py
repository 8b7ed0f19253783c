"""Poses put on flat ground and let come to rest, on the host and the same for every engine."""

from __future__ import annotations

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from getup_jax.physics.character import CharacterSpec


def settle(
    character: CharacterSpec, qpos: np.ndarray, seconds: float
) -> tuple[np.ndarray, np.ndarray]:
    """qpos [P, 7 + J] and qvel [P, 6 + J] after the time under the poses' own servos.

    A pose that the simulation cannot hold stays as it was, at rest.
    """
    qpos = np.asarray(qpos, np.float64)
    steps = round(seconds / character.model.opt.timestep)
    still = np.zeros((len(qpos), character.model.nv))
    if steps == 0 or not len(qpos):
        return qpos, still
    batch = Batch(character.model, len(qpos))
    batch.qpos[:], batch.ctrl[:] = qpos, qpos[:, 7:]
    try:
        batch.step(nstep=steps)
    except SimulationError as error:
        batch.qpos[error.ids] = np.nan
    # MuJoCo resets a diverged simulation and counts a warning: (last info, number) of each kind
    held = np.isfinite(batch.qpos).all(axis=1) & (batch.warning[..., 1].sum(axis=1) == 0)
    keep = held[:, None]
    return np.where(keep, batch.qpos, qpos), np.where(keep, batch.qvel, still)


def lift_to_ground(character: CharacterSpec, qpos: np.ndarray, gap_m: float) -> np.ndarray:
    """Poses [P, 7 + J] moved up or down until their lowest point is gap_m above z = 0."""
    model, data, qpos = character.model, mujoco.MjData(character.model), qpos.copy()
    floor = [i for i in range(model.ngeom) if model.geom_bodyid[i] == 0]
    body = [i for i in range(model.ngeom) if model.geom_bodyid[i] > 0 and model.geom_contype[i]]
    far = 10.0
    for row in qpos:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        lowest = min(mujoco.mj_geomDistance(model, data, floor[0], g, far, None) for g in body)
        row[2] += gap_m - lowest
    return qpos
