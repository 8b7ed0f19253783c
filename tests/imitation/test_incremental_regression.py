"""Regression that goes on with one optimiser while demonstrations come in."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from compiled import first_policy
from getup_jax.imitation import action_regression, incremental_regression
from getup_jax.imitation.demonstrations import Demonstrations
from getup_jax.imitation.incremental_regression import IncrementalRegression

KEY = jax.random.PRNGKey(0)


@pytest.fixture
def parts(built) -> list[Demonstrations]:
    """Two batches of random demonstrations, of 100 and of 540."""
    task, _ = built
    env = task.environment
    observation = jax.random.normal(KEY, (640, env.observation_size))
    condition = env.observer.condition(observation)
    action = 0.3 * jax.random.normal(jax.random.PRNGKey(1), (640, env.action_size))
    target = env.decoder(task.world).target(action, condition)
    demos = jax.device_get(Demonstrations(observation, action, target, condition))
    return [jax.tree.map(lambda x, s=s: x[s], demos) for s in (slice(0, 100), slice(100, 640))]


def test_samples_are_drawn_from_all_batches_alike_and_stay_whole(parts):
    drawn = incremental_regression._drawn(parts, 6400, np.random.default_rng(0))
    number = {row.tobytes(): i for i, row in enumerate(np.concatenate([p.action for p in parts]))}
    rows = [number[row.tobytes()] for row in drawn.action]
    counts = np.bincount(rows, minlength=640)
    assert 5 < counts[:100].mean() < 15
    assert 5 < counts[100:].mean() < 15
    targets = np.concatenate([p.target for p in parts])
    np.testing.assert_array_equal(drawn.target, targets[rows])


def test_it_learns_all_batches_and_goes_on_where_it_was(built, parts, monkeypatch):
    monkeypatch.setattr(incremental_regression, "_MINIBATCH", 32)
    task, learner = built
    decoder, policy = task.environment.decoder(task.world), first_policy(learner)

    def learned(*rounds: int) -> IncrementalRegression:
        regression = IncrementalRegression(learner, policy, decoder, updates=200)
        rng = np.random.default_rng(0)
        for updates in rounds:
            regression.learn(parts, updates, rng)
        return regression

    once, twice = learned(200), learned(100, 100)
    # with a fresh optimiser the second round would have other steps
    jax.tree.map(np.testing.assert_array_equal, once.policy.actor, twice.policy.actor)
    for part in parts:
        before = action_regression.compare(learner, policy, decoder, part)[0]
        assert action_regression.compare(learner, once.policy, decoder, part)[0] < 0.97 * before


def test_what_is_no_whole_portion_is_refused(built, parts):
    task, learner = built
    decoder = task.environment.decoder(task.world)
    regression = IncrementalRegression(learner, first_policy(learner), decoder, updates=200)
    empty = [jax.tree.map(lambda x: x[:0], part) for part in parts]
    for demos, updates in ((parts, 30), (empty, 50)):
        with pytest.raises(ValueError, match="expected a multiple of 50 updates"):
            regression.learn(demos, updates, np.random.default_rng(0))
