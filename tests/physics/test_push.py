from __future__ import annotations

import copy
import dataclasses

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.physics.mjx import MjxEngine
from getup_jax.physics.native import NativeEngine
from getup_jax.physics.push import push, velocity_change

LINK = "spine_upper"
PUSH = np.array([12.0, -16.0, 0.0])  # Ns


@pytest.fixture(scope="module")
def flying(character) -> np.ndarray:
    """The neutral pose, bent, turned and off the ground."""
    pose = character.neutral_qpos.copy()
    pose[2] += 1.0
    pose[3:7] = 0.5, 0.5, -0.5, 0.5
    pose[7:] += 0.2
    return pose


def momentum(character, qpos, qvel) -> tuple[np.ndarray, np.ndarray]:
    """Linear momentum (Ns), and angular momentum about the world's origin (Nms)."""
    data = mujoco.MjData(character.model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    mujoco.mj_forward(character.model, data)
    mujoco.mj_subtreeVel(character.model, data)
    linear = data.subtree_linvel[1] * character.model.body_subtreemass[1]
    return linear, data.subtree_angmom[1] + np.cross(data.subtree_com[1], linear)


def without_armature(character):
    """Rotor inertia is in the joints' momentum alone, so the body's balance holds without it."""
    changed = copy.copy(character.model)
    changed.dof_armature[:] = 0.0
    return dataclasses.replace(character, model=changed)


def test_the_impulse_becomes_the_momentum_of_the_body(character, flying):
    bare = without_armature(character)
    (change,) = velocity_change(bare.model, flying[None], PUSH[None], character.link(LINK))
    data = mujoco.MjData(bare.model)
    data.qpos[:] = flying
    mujoco.mj_forward(bare.model, data)
    linear, angular = momentum(bare, flying, change)
    np.testing.assert_allclose(linear, PUSH, atol=1e-9)
    np.testing.assert_allclose(angular, np.cross(data.body(LINK).xipos, PUSH), atol=1e-9)


def test_the_work_of_the_impulse_is_the_energy_that_comes(character, flying):
    # from rest: kinetic energy = p . v / 2, with v of the pushed point
    model, data = character.model, mujoco.MjData(character.model)
    (change,) = velocity_change(model, flying[None], PUSH[None], character.link(LINK))
    data.qpos[:], data.qvel[:] = flying, change
    mujoco.mj_forward(model, data)
    inertia = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, inertia, change)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, jacobian, None, model.body(LINK).id)
    assert change @ inertia == pytest.approx(PUSH @ jacobian @ change)
    assert PUSH @ jacobian @ change > 1.0


def check_push(engine, character, flying, tolerance: float) -> None:
    """The first of three simulations is pushed; the others go on bit for bit."""
    qpos = np.tile(flying, (3, 1))
    state = engine.place(qpos, np.full((3, character.model.nv), 0.1))
    impulse = np.stack([PUSH, np.zeros(3), np.zeros(3)])
    after = push(engine, character, state, impulse, character.link(LINK))
    expected = 0.1 + velocity_change(character.model, qpos[:1], PUSH[None], character.link(LINK))
    np.testing.assert_allclose(after.kinematics.qvel[:1], expected, atol=tolerance)
    np.testing.assert_allclose(after.kinematics.qpos[:1], qpos[:1], atol=tolerance)
    for old, new in zip(jax.tree.leaves(state), jax.tree.leaves(after), strict=True):
        np.testing.assert_array_equal(old[1:], new[1:])
        assert (old.dtype, old.shape) == (new.dtype, new.shape)


def test_a_push_on_the_native_engine(character, flying):
    engine = NativeEngine(character, PhysicsConfig(engine="native"))
    check_push(engine, character, flying, 1e-5)


def test_a_pushed_simulation_moves_on(character, flying):
    engine = NativeEngine(character, PhysicsConfig(engine="native"))
    state = engine.place(np.tile(flying, (2, 1)), np.zeros((2, character.model.nv)))
    impulse = np.stack([PUSH, np.zeros(3)])
    state = push(engine, character, state, impulse, character.link(LINK))
    ctrl = jnp.asarray(np.tile(flying[7:], (2, 1)), jnp.float32)
    after = jax.jit(engine.step)(state, ctrl).kinematics
    travelled = np.asarray(after.link_position[0] - after.link_position[1])[character.link(LINK)]
    assert travelled[:2] @ PUSH[:2] / np.linalg.norm(PUSH) > 0.01


def test_a_failed_simulation_does_not_disturb_a_push(character, flying):
    engine = NativeEngine(character, PhysicsConfig(engine="native"))
    state = engine.place(np.tile(flying, (3, 1)), np.zeros((3, character.model.nv)))
    broken = state.kinematics.replace(qpos=state.kinematics.qpos.at[1].set(jnp.nan))
    impulse = np.stack([PUSH, np.zeros(3), np.zeros(3)])
    after = push(engine, character, state.replace(kinematics=broken), impulse, character.link(LINK))
    assert np.isfinite(after.kinematics.qvel[0]).all()
    assert np.isnan(after.kinematics.qpos[1]).all()


@pytest.mark.slow
def test_a_push_on_mjx(character, flying):
    engine = MjxEngine(character, PhysicsConfig(engine="mjx"), impl="jax")
    check_push(engine, character, flying, 1e-4)
