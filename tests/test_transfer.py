from __future__ import annotations

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import untrained_prior

from eval_samples import SMALL, make_policy, make_task
from getup_jax import lessons, transfer
from getup_jax.tasks.actions import Units
from getup_jax.transfer import Origin, carry_over

KEY = jax.random.PRNGKey(0)
CONFIG = dataclasses.replace(
    SMALL,
    network=dataclasses.replace(SMALL.network, hidden_sizes=(64,)),
    ppo=dataclasses.replace(
        SMALL.ppo, num_envs=16, num_steps=8, minibatch_size=64, normalize_observation=True
    ),
)


@pytest.fixture(scope="module")
def task():
    built = make_task(CONFIG)
    world = built.world.replace(prior=untrained_prior(built.environment.character, seed=1))
    return dataclasses.replace(built, world=world)


@pytest.fixture(scope="module")
def old(task) -> Units:
    return Units(untrained_prior(task.environment.character, seed=0), 0.5)


def samples(rng: np.random.Generator, size: int) -> tuple[jax.Array, jax.Array]:
    action = rng.normal(size=(size, 65)).astype(np.float32)
    return jnp.asarray(action), jnp.asarray(rng.uniform(0.2, 1.0, (size, 3)), jnp.float32)


def test_a_translated_action_has_the_same_servo_target(task, old):
    new = Units(task.world.prior, 0.25)
    action, condition = samples(np.random.default_rng(0), 32)
    translated = old.translate(action, condition, new)
    np.testing.assert_allclose(
        new.target(translated, condition), old.target(action, condition), atol=2e-6
    )
    assert np.abs(translated - action).max() > 0.5  # and is another action


def test_the_latent_is_that_of_the_old_pose_and_not_of_the_offsets(task, old):
    new = Units(task.world.prior, 0.25)
    action, condition = samples(np.random.default_rng(1), 8)
    bare = action.at[:, 16:].set(0.0)
    moved = old.translate(action, condition, new) - old.translate(bare, condition, new)
    np.testing.assert_allclose(moved[:, :16], 0.0, atol=1e-6)
    np.testing.assert_allclose(moved[:, 16:], 2.0 * action[:, 16:], atol=1e-5)


def test_an_action_that_means_the_same_leaves_the_policy_alone(task):
    learner, policy = make_policy(task, CONFIG)
    settings, log = CONFIG.task, []
    same = carry_over(
        learner, task.world, policy, Origin(settings, task.world.prior), KEY, log.append
    )
    assert same is policy
    assert log == []


def test_the_actor_learns_the_old_targets(task, old, monkeypatch):
    monkeypatch.setattr(transfer, "_ROLLOUTS", 8)
    monkeypatch.setattr(lessons, "_EPOCHS", 60)
    monkeypatch.setattr(lessons, "_MINIBATCH", 64)
    learner, policy = make_policy(task, CONFIG)
    settings = dataclasses.replace(CONFIG.task, offset_scale=old.offset_scale)
    log: list[str] = []
    taught = carry_over(learner, task.world, policy, Origin(settings, old.prior), KEY, log.append)
    after, before, _ = (float(word) for word in log[-1].split() if word[0].isdigit())
    assert after < 0.3 * before
    block = learner.env.observer.slices()["action"]
    kept = np.ones(learner.env.observation_size, bool)
    kept[block] = False
    for name in ("mean", "variance"):
        a, b = getattr(policy.statistics, name), getattr(taught.statistics, name)
        np.testing.assert_array_equal(a[kept], b[kept])
        assert (a[block] != b[block]).any()


def test_offsets_are_avoided_where_latents_can_say_the_same(task, monkeypatch):
    monkeypatch.setattr(transfer, "_ROLLOUTS", 8)
    monkeypatch.setattr(lessons, "_EPOCHS", 60)
    monkeypatch.setattr(lessons, "_MINIBATCH", 64)
    learner, policy = make_policy(task, CONFIG)
    lengths = []
    for weight in (0.0, 1.0):
        monkeypatch.setattr(lessons, "_NATURAL", weight)
        log: list[str] = []
        settings = dataclasses.replace(CONFIG.task, offset_scale=0.5)
        prior = untrained_prior(task.environment.character, seed=0)
        carry_over(learner, task.world, policy, Origin(settings, prior), KEY, log.append)
        lengths.append(float(log[-1].split()[-2]))
    assert lengths[1] < 0.7 * lengths[0]


def test_the_difference_is_the_root_mean_square_in_degrees(task, old):
    learner, policy = make_policy(task, CONFIG)
    action, condition = samples(np.random.default_rng(2), 4)
    observation = jnp.ones((4, learner.env.observation_size))
    target = old.target(learner.act(policy, observation), condition) + math.radians(3.0)
    lesson = lessons.Lesson(observation, action, target, condition)
    assert lessons.compare(learner, policy, old, lesson)[0] == pytest.approx(3.0, rel=1e-3)
