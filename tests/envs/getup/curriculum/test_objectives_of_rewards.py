"""A sharper tracking kernel, and tracking as an objective of its own."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import changed, tiny_task

from getup_jax.config import Config, ConfigError, CurriculumConfig, NetworkConfig, PPOConfig
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.envs.getup.episode import LYING
from getup_jax.rl.learner import make_learner
from getup_jax.training import run

PPO = PPOConfig(num_envs=8, num_steps=3, epochs=1, minibatch_size=24, popart=True)
NETWORK = NetworkConfig(hidden_sizes=(8,))
SHARP: Config = dataclasses.replace(
    changed(reward_sharpness=1.5, track_weight=0.5, track_sharpness=3.0), ppo=PPO, network=NETWORK
)


@pytest.fixture(scope="module")
def sharp(character) -> BuiltTask:
    return tiny_task(character, SHARP)


def one_step(built: BuiltTask):
    """A state of four lying episodes with some offsets after a step, and what the step gave."""
    env, rows = built.environment, jnp.arange(4)
    state = env.start(built.world, rows % 2, jnp.full(4, LYING), rows)
    state = state.replace(action=state.action.at[:, -9:].set(0.5), time=state.time + 0.3)
    return jax.jit(env.advance)(built.world, state, state.action)


def test_what_is_paid_is_sharper_and_what_is_reported_is_the_papers(built, sharp):
    (plain_state, plain), (state, output) = one_step(built), one_step(sharp)
    terms = {name: np.asarray(x) for name, x in output.terms.items()}
    for name in ("height", "orientation", "velocity", "posture", "task", "natural"):
        np.testing.assert_array_equal(terms[name], plain.terms[name])
    tracked = terms["height"] * terms["orientation"]
    assert (tracked < 0.95).all()
    total = terms["task"] * terms["natural"] * tracked**0.5
    np.testing.assert_allclose(terms["total"], total, rtol=1e-5)
    np.testing.assert_allclose(terms["track"], tracked**3, rtol=1e-5)
    np.testing.assert_array_equal(output.reward[:, 0], terms["total"])
    np.testing.assert_array_equal(output.reward[:, 1], terms["track"])
    jax.tree.map(np.testing.assert_array_equal, state.record, plain_state.record)
    assert plain.reward.shape == (4, 1)
    assert "track" not in plain.terms


def test_tracking_may_have_a_discount_of_its_own(built, sharp):
    assert sharp.environment.discounts(0.99) is None
    assert built.environment.discounts(0.99) is None
    aids = sharp.environment.curriculum
    aids = dataclasses.replace(aids, config=dataclasses.replace(aids.config, track_discount=0.9))
    env = dataclasses.replace(sharp.environment, curriculum=aids)
    learner = make_learner(env, NETWORK, PPO, total_steps=100, discounts=env.discounts(0.99))
    np.testing.assert_allclose(learner.discount, [0.99, 0.9])
    with pytest.raises(ValueError, match="discounts: expected 2, got"):
        make_learner(env, NETWORK, PPO, total_steps=100, discounts=[0.9])


def test_a_grace_time_pays_no_objective(character):
    # the head counts as on the floor wherever it is
    lenient = tiny_task(character, changed(SHARP, head_grace_s=9.0, head_clearance_m=9.0))
    env, rows = lenient.environment, jnp.arange(4)
    state = env.start(lenient.world, rows % 2, jnp.full(4, LYING), rows)
    held = state.replace(head_steps=jnp.array([0, 0, 20, 20]))
    _, output = jax.jit(env.advance)(lenient.world, held, state.action)
    assert (np.asarray(output.reward[:2]) > 0.1).all()
    np.testing.assert_array_equal(output.reward[2:], 0.0)
    assert (np.asarray(output.terms["task"]) > 0.1).all()


def test_the_learner_has_a_critic_each_with_the_weights_that_are_set(sharp, monkeypatch):
    monkeypatch.setattr(run, "build_task", lambda config, log: sharp)
    job = run.build_job(SHARP, lambda text: None)
    np.testing.assert_allclose(job.learner.weights, (2 / 3, 1 / 3))
    state = jax.jit(job.learner.init)(job.world, jax.random.PRNGKey(0))
    value = job.learner.value(state.learner, state.environment.observation)
    assert value.shape == (8, 2)
    _, metrics = jax.jit(job.learner.iteration)(job.world, state)
    assert 0.0 < float(metrics["rollout/reward_track"]) < 1.0


def test_each_term_can_be_an_objective_with_a_critic_of_its_own(character, built):
    config = changed(SHARP, objectives="terms", track_weight=0.0)
    env = tiny_task(character, config).environment
    terms = ("height", "orientation", "velocity", "posture", "natural")
    assert env.objective_weights == dict.fromkeys(terms, 1.0)
    _, output = one_step(dataclasses.replace(built, environment=env))
    for index, name in enumerate(terms):
        np.testing.assert_array_equal(output.reward[:, index], output.terms[name])
    assert output.reward.shape == (4, env.num_objectives)


def test_without_a_pose_prior_no_term_is_natural(built):
    aids = built.environment.curriculum
    aids = dataclasses.replace(aids, config=CurriculumConfig(objectives="terms"))
    env = dataclasses.replace(built.environment, latent_size=0, curriculum=aids)
    assert "natural" not in env.objective_weights


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"reward_sharpness": 0.0}, r"curriculum\.reward_sharpness: expected a number more than 0"),
        ({"track_sharpness": -1.0}, r"curriculum\.track_sharpness: expected a number more than 0"),
        (
            {"track_height_sharpness": 0.0},
            r"curriculum\.track_height_sharpness: expected a number more than 0",
        ),
        ({"objectives": "all"}, r"curriculum\.objectives: expected one of .*'terms'.*, got 'all'"),
        (
            {"track_weight": -0.1},
            r"curriculum\.track_weight: expected a number from 0 to 1000, got -0\.1",
        ),
    ],
)
def test_mistakes_of_the_settings(settings, message):
    with pytest.raises(ConfigError, match=message):
        CurriculumConfig(**settings)
