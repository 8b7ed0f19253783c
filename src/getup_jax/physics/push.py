"""An impulse on a link, worked out on the host and the same for every engine."""

from __future__ import annotations

import jax.numpy as jnp
import mujoco
import numpy as np

from getup_jax.core.types import Engine, PhysicsState, select
from getup_jax.physics.character import CharacterSpec


def push(
    engine: Engine, character: CharacterSpec, state: PhysicsState, impulse: np.ndarray, link: int
) -> PhysicsState:
    """Simulations after an impulse [B, 3] (Ns, world) at a link's centre of mass; zero: as before.

    A pushed simulation is placed anew with its changed velocity, so it loses the solver's first
    guess, and its positions are rounded to float32. The contacts answer in the next step.
    """
    hit = np.linalg.norm(impulse, axis=-1) > 0
    size = len(hit)
    # the others are not kept, but must be poses that an engine can place
    qpos = np.tile(character.neutral_qpos, (size, 1))
    qvel = np.zeros((size, character.model.nv))
    qpos[hit] = np.asarray(state.kinematics.qpos)[hit]
    change = velocity_change(character.model, qpos[hit], impulse[hit], link)
    qvel[hit] = np.asarray(state.kinematics.qvel)[hit] + change
    return select(jnp.asarray(hit), engine.place(qpos, qvel), state)


def velocity_change(
    model: mujoco.MjModel, qpos: np.ndarray, impulse: np.ndarray, link: int
) -> np.ndarray:
    """dv = M^-1 J^T p [n, 6 + J] of impulses p [n, 3] (Ns) at poses [n, 7 + J].

    M is the joint-space inertia and J the Jacobian of the link's centre of mass.
    """
    data, jacobian = mujoco.MjData(model), np.zeros((3, model.nv))
    change = np.zeros((len(qpos), model.nv))
    for out, pose, p in zip(change, qpos, impulse, strict=True):
        data.qpos[:] = pose
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_jacBodyCom(model, data, jacobian, None, link + 1)
        mujoco.mj_solveM(model, data, out[None], (jacobian.T @ p)[None])
    return change
