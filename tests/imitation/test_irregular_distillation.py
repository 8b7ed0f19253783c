"""Two policies, one of the plane and one of irregular ground, teach a third one."""

from __future__ import annotations

import dataclasses
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from ground_samples import TERRAIN

from compiled import first_policy
from eval_samples import SMALL, make_task, save_policy
from getup_jax.config import Config, ConfigError, TrainConfig
from getup_jax.imitation import incremental_regression, irregular_distillation
from getup_jax.imitation.action_distillation import Teacher
from getup_jax.imitation.irregular_distillation import distill_on_irregular
from getup_jax.runtime.checkpoint import load_policy
from getup_jax.training.run import _knows_irregular_ground

KEY = jax.random.PRNGKey(0)


@pytest.fixture(scope="module")
def teacher(built):
    task, learner = built
    env = task.environment
    policy = first_policy(learner, seed=1)
    # a fresh actor hardly moves; this one does
    policy = dataclasses.replace(policy, actor=jax.tree.map(lambda x: 4.0 * x, policy.actor))
    return Teacher(
        learner.model, policy, env.decoder(task.world), env.observer, env.config.lookahead_s
    )


def test_each_of_the_two_says_what_to_do_on_the_ground_that_it_knows(built, teacher):
    task, learner = built
    env, policy = task.environment, first_policy(learner)
    state = jax.jit(env.init, static_argnums=2)(task.world, KEY, 64)
    demos = irregular_distillation._demonstrate(
        learner, task.world, policy, teacher, state.observation
    )
    block = env.observer.slices()["height_map"]
    even = np.ptp(np.asarray(state.observation)[:, block], axis=1) < 1e-4
    assert 4 < even.sum() < 60
    condition, decoder = env.observer.condition(state.observation), env.decoder(task.world)
    own = learner.act(policy, env.observer.evened(state.observation))
    np.testing.assert_allclose(demos.action[even], own[even], atol=1e-5)
    other = teacher.demonstrate(env, decoder, state.observation)
    np.testing.assert_allclose(demos.target[~even], other.target[~even], atol=1e-4)
    assert np.abs(demos.target - decoder.target(own, condition))[~even].max() > 0.05
    np.testing.assert_allclose(demos.target, decoder.target(demos.action, condition), atol=1e-4)


def test_only_bodies_near_their_curves_are_learned_from(built, teacher):
    task, learner = built
    env = task.environment
    state = jax.jit(env.init, static_argnums=2)(task.world, KEY, 32)
    start = jax.jit(env.start)(task.world, state.getup, state.kind, state.getup * 0)
    observation = start.observation
    demos = irregular_distillation._demonstrate(
        learner, task.world, first_policy(learner), teacher, observation
    )
    features = env.observer.slices()["features"]
    far = observation.at[:20, features].add(jnp.asarray([0.0, 0.0, 1.5]))  # e^-2.25 = .1 less
    left = irregular_distillation._that_follow(env, demos.replace(observation=far))
    np.testing.assert_array_equal(left.observation, far[20:])
    np.testing.assert_array_equal(left.target, demos.target[20:])


@pytest.mark.slow
def test_the_policy_learns_from_the_two(built, teacher, monkeypatch):
    monkeypatch.setattr(incremental_regression, "_MINIBATCH", 64)
    monkeypatch.setattr(incremental_regression, "_LEARNING_RATES", (1e-3, 1e-4))
    for name, value in ("_SAMPLES", 1280), ("_ON_PLANE", 640), ("_ROUNDS", 3), ("_UPDATES", 600):
        monkeypatch.setattr(irregular_distillation, name, value)
    task, learner = built
    log: list[str] = []
    distill_on_irregular(learner, task.world, first_policy(learner), teacher, KEY, log.append)
    rounds = [[float(x) for x in re.findall(r"[0-9]+\.[0-9]+", line)] for line in log[1:]]
    assert len(rounds) == 4
    (first, plane_first), *_, (last, plane) = rounds  # degrees; in states that are new each time
    assert last < 0.85 * first, log
    assert plane_first < 1e-3  # where it began with the right weights
    assert plane < last, log
    assert all(("left" in line) == (0 < number < 3) for number, line in enumerate(log[1:]))


@pytest.mark.parametrize(
    ("train", "terrain", "message"),
    [
        ({"irregular_from": "b"}, True, r"train\.irregular_from: expected train\.init_from, of a"),
        (
            {"irregular_from": "b", "init_from": "a", "init_learner": True},
            True,
            r"no train\.init_learner, got 'b'",
        ),
        ({"irregular_from": "b", "init_from": "a"}, False, r"expected null on a flat plane"),
    ],
)
def test_settings_that_do_not_go_together_are_refused(train, terrain, message):
    with pytest.raises(ConfigError, match=message):
        Config(train=TrainConfig(**train), terrain=TERRAIN if terrain else None)


def test_a_second_policy_of_the_plane_is_refused(tmp_path):
    task = make_task(SMALL)
    folder = save_policy(tmp_path / "plane", task)
    start = load_policy(folder)
    config = dataclasses.replace(
        SMALL,
        terrain=TERRAIN,
        train=TrainConfig(init_from=str(folder), irregular_from=str(folder)),
    )
    message = r"train\.irregular_from: expected a policy of irregular ground, got .*plane"
    with pytest.raises(ConfigError, match=message):
        _knows_irregular_ground(config, start)
