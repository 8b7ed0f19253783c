"""The engine alone does what a rollout has it do, and a test that it would be seen if not."""

from __future__ import annotations

import dataclasses
import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import CONFIG, changed, tiny_task

from getup_jax.config import NetworkConfig, PhysicsConfig, PPOConfig
from getup_jax.core.types import PropCommand
from getup_jax.physics.character import load_character
from getup_jax.physics.native import NativeEngine
from getup_jax.physics.props import Ball, Equipment
from getup_jax.rl.learner import make_learner
from support.replay import BatchLoop, ReplayError, engine_of, make_script
from support.scanned import recorded_of, scan_run

SIZE, STEPS = 8, 6
# a hand that lifts, and episodes that end after three steps of little reward
SETTINGS = changed(
    stand_start=0.0,
    prioritisation=0.9,
    assistive_wrench=0.5,
    assisted_share=0.9,
    terminate_after_s=0.1,
)


@pytest.fixture(scope="module")
def learner_and_world():
    config = changed(SETTINGS, terminate_reward=1.0)
    task = tiny_task(load_character(config.physics), config)
    ppo = PPOConfig(num_envs=SIZE, num_steps=STEPS, minibatch_size=SIZE * STEPS)
    network = NetworkConfig(hidden_sizes=(16,))
    return make_learner(task.environment, network, ppo, total_steps=1000), task.world


@pytest.fixture(scope="module")
def script(learner_and_world):
    learner, world = learner_and_world
    state = jax.jit(learner.init)(world, jax.random.PRNGKey(0))
    return make_script(
        engine_of(learner.env),
        SIZE,
        lambda: jax.jit(lambda w, s: learner.collect(w, s))(world, state),
    )


def loop(learner_and_world, script) -> BatchLoop:
    return BatchLoop(engine_of(learner_and_world[0].env).model, CONFIG.physics, script)


def test_the_engine_alone_comes_to_the_rollouts_states(learner_and_world, script):
    assert script.rows.shape[:2] == (STEPS + 1, SIZE)
    assert script.wrench is not None
    assert np.abs(script.wrench).max() > 1.0, "no hand to replay"
    assert script.ended.any(), "no new start to replay"
    assert not script.ended.all()
    loop(learner_and_world, script).checked()()


@pytest.mark.parametrize("part", ["ctrl", "wrench", "ended"])
def test_whatever_is_left_out_is_seen(learner_and_world, script, part):
    value = getattr(script, part)
    changed = dataclasses.replace(script, **{part: np.zeros_like(value)})
    with pytest.raises(ReplayError, match="raw and rollout differ after step"):
        loop(learner_and_world, changed).checked()


def test_balls_are_put_where_the_engine_puts_them():
    balls = (Ball("red", 0.05, 0.1), Ball("blue", 0.05, 0.1))
    physics = PhysicsConfig(engine="native", character="humanoid28", substeps=4)
    character = load_character(physics, equipment=Equipment(balls=balls))
    engine = NativeEngine(character, physics)
    qpos = np.tile(character.neutral_qpos, (SIZE, 1))
    start = engine.place(qpos, np.zeros((SIZE, 6 + character.num_joints)))
    command = PropCommand(
        mask=jnp.arange(2 * SIZE).reshape(SIZE, 2) % 3 == 0,
        position=jnp.full((SIZE, 2, 3), 1.5),
        velocity=jnp.full((SIZE, 2, 3), 0.5),
    )

    @jax.jit
    def collect(state):
        for number in range(STEPS):
            now = command.replace(mask=command.mask & (number % 2 == 0))
            state = engine.step(state, jnp.asarray(qpos[:, 7:], jnp.float32), now)
        return state

    none = jnp.zeros((STEPS, SIZE), bool)
    samples = types.SimpleNamespace(terminated=none, truncated=none)
    script = make_script(
        engine,
        SIZE,
        lambda: types.SimpleNamespace(
            environment=types.SimpleNamespace(physics=collect(start)), transition=samples
        ),
    )
    assert [part.shape for part in script.balls] == [(STEPS, SIZE, 2), *[(STEPS, SIZE, 2, 3)] * 2]
    BatchLoop(engine.model, physics, script).checked()
    mask, position, velocity = script.balls
    moved = dataclasses.replace(script, balls=(mask, position + 0.01, velocity))
    with pytest.raises(ReplayError, match="after step 1"):
        BatchLoop(engine.model, physics, moved).checked()


@pytest.mark.slow
def test_an_engine_of_jax_is_recorded_and_scanned(learner_and_world):
    """Any engine is one of JAX as far as the scan can see."""
    learner, world = learner_and_world
    state = jax.jit(learner.init)(world, jax.random.PRNGKey(0))
    recorded = recorded_of(learner.env)
    recording = dataclasses.replace(learner, env=recorded)
    collected = jax.jit(recording.collect)(world, state)
    last = collected.environment.physics
    done = scan_run(engine_of(learner.env), collected, last)()
    np.testing.assert_allclose(done.kinematics.qpos, last.kinematics.qpos, atol=1e-4)
