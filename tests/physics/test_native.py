from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch
from poses import lying, random_targets

from getup_jax.config import PhysicsConfig
from getup_jax.core.types import PhysicsState, select, take
from getup_jax.envs.getup import rewards
from getup_jax.physics import native
from getup_jax.physics.character import load_character
from getup_jax.physics.engine import make_engine
from getup_jax.physics.native import NativeEngine

CONFIG = PhysicsConfig(engine="native")
INTEGRATION = mujoco.mjtState.mjSTATE_INTEGRATION


@pytest.fixture(scope="module")
def engine(character) -> NativeEngine:
    return NativeEngine(character, CONFIG)


def start(engine: NativeEngine, character, count: int, seed: int = 0) -> PhysicsState:
    qpos = lying(character, count, seed)
    qvel = np.random.default_rng(seed).normal(scale=0.3, size=(count, character.model.nv))
    return engine.place(qpos, qvel)


def run(engine: NativeEngine, state: PhysicsState, targets: np.ndarray):
    """The last state and all states [T, ...] of a scan inside jit, as NumPy arrays."""
    return jax.tree.map(np.asarray, _run(engine, state, targets))


@functools.partial(jax.jit, static_argnums=0)
def _run(engine: NativeEngine, state: PhysicsState, targets: jax.Array):
    def step(state: PhysicsState, ctrl: jax.Array):
        state = engine.step(state, ctrl)
        return state, state

    return jax.lax.scan(step, state, targets)


def rows_of(state: PhysicsState) -> np.ndarray:
    """Integration states [..., nstate] in float64."""
    return np.array(state.engine).view(np.float64)


def assert_same(a, b) -> None:
    jax.tree.map(np.testing.assert_array_equal, a, b)


def warnings_of(engine: NativeEngine, size: int) -> int:
    """MuJoCo warnings of all simulations so far."""
    return int(engine._batches[size]._batch.warning[..., 1].sum())


# The engine does what MuJoCo does, bit for bit.


@pytest.mark.parametrize("solver", ["pgs", "newton"])
def test_100_steps_are_those_of_plain_mujoco(solver):
    config = dataclasses.replace(CONFIG, solver=solver)
    character = load_character(config)
    engine = NativeEngine(character, config)
    size, steps = 4, 100
    first = start(engine, character, size)
    targets = random_targets(character, steps, size)
    _, states = run(engine, first, targets)
    got = rows_of(states)
    assert np.isfinite(got).all()

    batch = Batch(engine.model, size, nthread=1)
    batch.state[...] = rows_of(first)
    data = [mujoco.MjData(engine.model) for _ in range(size)]
    for one, row in zip(data, rows_of(first), strict=True):
        mujoco.mj_setState(engine.model, one, row, INTEGRATION)
    row = np.empty(got.shape[-1])
    for t in range(steps):
        batch.ctrl = targets[t]
        batch.step(nstep=config.substeps)
        np.testing.assert_array_equal(got[t], batch.state)
        for i, one in enumerate(data):
            one.ctrl[:] = targets[t, i]
            mujoco.mj_step(engine.model, one, config.substeps)
            mujoco.mj_getState(engine.model, one, row, INTEGRATION)
            np.testing.assert_array_equal(got[t, i], row)


def test_the_character_moves_and_touches_the_floor(engine, character):
    # without this, the comparisons would compare nothing
    first = start(engine, character, 4)
    last, _ = run(engine, first, random_targets(character, 100, 4))
    assert np.abs(last.kinematics.qpos - first.kinematics.qpos).max() > 0.5
    assert 0.0 < last.kinematics.link_position[..., 2].min() < 0.2


def test_kinematics_are_those_of_the_new_state(engine, character):
    state = start(engine, character, 3)
    state, _ = run(engine, state, random_targets(character, 6, 3))
    model, data = engine.model, mujoco.MjData(engine.model)
    velocity, kinematics = np.empty(6), state.kinematics
    for i, row in enumerate(rows_of(state)):
        mujoco.mj_setState(model, data, row, INTEGRATION)
        np.testing.assert_allclose(kinematics.qpos[i], data.qpos, atol=1e-6)
        np.testing.assert_allclose(kinematics.qvel[i], data.qvel, atol=1e-5)
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(kinematics.link_position[i], data.xpos[1:], atol=1e-6)
        np.testing.assert_allclose(kinematics.link_quaternion[i], data.xquat[1:], atol=1e-6)
        for link in range(20):
            body = mujoco.mjtObj.mjOBJ_XBODY
            mujoco.mj_objectVelocity(model, data, body, link + 1, velocity, 0)
            angular, linear = velocity[:3], velocity[3:]
            got = kinematics.link_angular_velocity[i, link]
            np.testing.assert_allclose(got, angular, atol=1e-4)
            np.testing.assert_allclose(kinematics.link_linear_velocity[i, link], linear, atol=1e-4)
    assert np.abs(kinematics.link_linear_velocity).max() > 0.1


def test_torques_are_those_of_the_servos_and_inside_the_limits(engine, character):
    state = start(engine, character, 2)
    far = np.tile(character.joint_upper + 10.0, (1, 2, 1)).astype(np.float32)
    state, _ = run(engine, state, far)
    limit = np.tile(character.torque_limit, (2, 1))
    np.testing.assert_allclose(state.kinematics.torque, limit, rtol=1e-6)


def test_place_keeps_positions_and_velocities(engine, character):
    qpos = lying(character, 3)
    qvel = np.random.default_rng(0).normal(size=(3, 55))
    kinematics = engine.place(qpos, qvel).kinematics
    np.testing.assert_array_equal(kinematics.qpos, qpos.astype(np.float32))
    np.testing.assert_array_equal(kinematics.qvel, qvel.astype(np.float32))
    np.testing.assert_allclose(kinematics.link_position[:, 0], qpos[:, :3], atol=1e-6)
    np.testing.assert_allclose(kinematics.link_linear_velocity[:, 0], qvel[:, :3], atol=1e-6)
    assert np.asarray(kinematics.finite).all()


# A step is a pure function of its arguments.


def test_the_same_state_twice_gives_the_same_result(engine, character):
    step = jax.jit(engine.step)
    first, other = start(engine, character, 4), start(engine, character, 4, seed=7)
    a, b, c = (jnp.asarray(x) for x in random_targets(character, 3, 4))
    once = step(first, a)
    assert_same(step(first, a), once)
    # whatever the batch did in between: further steps, other states, a reset
    step(once, b)
    step(other, c)
    engine.place(lying(character, 4, seed=9), np.zeros((4, 55)))
    assert_same(step(first, a), once)
    twice = step(once, b)
    step(other, c)
    assert_same(step(once, b), twice)


def test_rows_do_not_depend_on_each_other_or_on_their_order(engine, character):
    first, other = start(engine, character, 6), start(engine, character, 6, seed=7)
    targets = random_targets(character, 6, 6)
    last, _ = run(engine, first, targets)

    order = np.array([3, 0, 5, 1, 4, 2])
    shuffled, _ = run(engine, take(first, order), targets[:, order])
    assert_same(shuffled, take(last, order))

    keep = np.arange(6) < 2
    mixed, _ = run(engine, select(keep, first, other), targets)
    assert_same(take(mixed, np.arange(2)), take(last, np.arange(2)))
    assert not np.array_equal(mixed.engine[2:], last.engine[2:])

    few, _ = run(engine, take(first, np.arange(3)), targets[:, :3])
    assert_same(few, take(last, np.arange(3)))


def test_a_scan_inside_jit_is_a_loop_outside(engine, character):
    state, targets = start(engine, character, 3), random_targets(character, 6, 3)
    last, _ = run(engine, state, targets)
    for ctrl in targets:
        state = engine.step(state, jnp.asarray(ctrl))
    assert_same(state, last)


def test_a_reset_is_a_selection_of_rows(engine, character):
    pool, targets = start(engine, character, 3, seed=5), random_targets(character, 6, 3)
    used, _ = run(engine, start(engine, character, 3), targets)
    fresh, _ = run(engine, select(np.ones(3, bool), pool, used), targets)
    assert_same(fresh, run(engine, pool, targets)[0])


# Failures are seen, and stay where they are.


def test_a_simulation_with_nan_is_reported_and_leaves_the_others_alone(engine, character):
    qpos, targets = lying(character, 4), random_targets(character, 3, 4)
    good, _ = run(engine, engine.place(qpos, np.zeros((4, 55))), targets)
    qpos[2, 9] = np.nan
    placed = engine.place(qpos, np.zeros((4, 55)))
    bad, states = run(engine, placed, targets)
    np.testing.assert_array_equal(placed.kinematics.finite, [True, True, False, True])
    np.testing.assert_array_equal(states.kinematics.finite, [[True, True, False, True]] * 3)
    others = np.array([0, 1, 3])
    assert_same(take(bad, others), take(good, others))
    # a reset brings the simulation back
    healed, _ = run(engine, select(bad.kinematics.finite, bad, good), targets)
    assert healed.kinematics.finite.all()


def test_a_diverged_simulation_is_reported(engine, character):
    qvel = np.zeros((2, 55))
    qvel[1, 3] = 1e5
    state = jax.jit(engine.step)(engine.place(lying(character, 2), qvel), jnp.zeros((2, 49)))
    np.testing.assert_array_equal(state.kinematics.finite, [True, False])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_target_that_is_not_finite_does_not_poison(engine, character, value):
    targets = random_targets(character, 3, 2)
    targets[1, 0, :5] = value
    last, states = run(engine, start(engine, character, 2), targets)
    assert states.kinematics.finite.all()
    assert np.isfinite(rows_of(states)).all()
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(last.kinematics))


def test_the_callers_model_is_not_changed(character):
    before = character.model.opt.disableflags
    engine = NativeEngine(character, CONFIG)
    assert character.model.opt.disableflags == before
    assert engine.model.opt.disableflags != before


def test_auto_is_native_on_a_cpu(character):
    if jax.default_backend() != "cpu":
        pytest.skip("no CPU backend")
    assert make_engine(character, PhysicsConfig(engine="auto")).name == "native"


# The physics is quiet: the first condition for learning anything.


def test_holding_the_neutral_pose_is_quiet(engine, character):
    count = round(4.0 / engine.control_dt)
    hold = np.tile(character.neutral_qpos[7:], (count, 1, 1)).astype(np.float32)
    placed = engine.place(character.neutral_qpos[None], np.zeros((1, 55)))
    _, states = run(engine, placed, hold)
    kinematics = states.kinematics
    after = round(1.0 / engine.control_dt)
    assert kinematics.qpos[:, 0, 2].min() > 0.85
    omega = kinematics.link_angular_velocity[after:, 0, 1:].reshape(-1, 57)
    assert np.linalg.norm(omega, axis=-1).max() < 0.2
    assert rewards.velocity(omega, jnp.array(1.0)).min() > 0.95


def test_random_targets_do_not_break_the_simulation(engine, character):
    size = 64
    before = warnings_of(engine, size) if size in engine._batches else 0
    first = start(engine, character, size)
    _, states = run(engine, first, random_targets(character, 20, size))
    assert states.kinematics.finite.all()
    assert warnings_of(engine, size) == before


def test_the_warning_counter_counts(engine, character):
    qpos = lying(character, 5)
    qpos[2, 9] = np.nan
    jax.block_until_ready(engine.step(engine.place(qpos, np.zeros((5, 55))), jnp.zeros((5, 49))))
    assert warnings_of(engine, 5) > 0


@pytest.mark.slow
def test_a_million_steps_of_a_random_policy(engine, character):
    size, chunk = 256, 100
    chunks = -(-1_000_000 // (size * chunk))
    neutral = jnp.asarray(character.neutral_qpos[7:], jnp.float32)
    lower, upper = jnp.asarray(character.joint_lower), jnp.asarray(character.joint_upper)

    @jax.jit
    def play(state, filtered, key):
        def step(carry, key_step):
            state, filtered = carry
            filtered = 0.8 * filtered + 0.2 * jax.random.normal(key_step, filtered.shape)
            state = engine.step(state, jnp.clip(neutral + filtered, lower, upper))
            return (state, filtered), state.kinematics.finite.all()

        return jax.lax.scan(step, (state, filtered), jax.random.split(key, chunk))

    state, filtered = start(engine, character, size), jnp.zeros((size, 49))
    for key in jax.random.split(jax.random.PRNGKey(0), chunks):
        (state, filtered), finite = play(state, filtered, key)
        assert np.asarray(finite).all()
    assert warnings_of(engine, size) == 0


def test_many_states_are_placed_some_at_a_time_and_nothing_is_kept(character, monkeypatch):
    qpos = lying(character, 7, seed=2)
    qvel = np.random.default_rng(2).normal(size=(7, character.model.nv))
    engine = NativeEngine(character, CONFIG)
    whole = engine.place(qpos, qvel)
    monkeypatch.setattr(native, "PLACE_CHUNK", 3)
    assert_same(engine.place(qpos, qvel), whole)
    assert whole.kinematics.qpos.shape[0] == 7
    assert engine._batches == {}
