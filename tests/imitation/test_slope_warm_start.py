"""A policy of the flat plane is taught to stand on slopes."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from compiled import first_policy
from getup_jax.imitation import action_regression, slope_warm_start

KEY = jax.random.PRNGKey(0)


def test_held_poses_are_those_of_the_starts_and_stand(built):
    task, learner = built
    demos = slope_warm_start._held(learner, task.environment, task.world, KEY)
    height = np.asarray(demos.observation)[:, task.environment.observer.slices()["features"]][:, 0]
    assert 16 < len(height) <= 16 * slope_warm_start._HOLD_STEPS // slope_warm_start._LOOK_STEPS
    assert np.ptp(height) < 0.4
    angles = np.asarray(task.world.pool.physics.kinematics.qpos)[:, 7:]
    gap = np.abs(np.asarray(demos.target)[:, None] - angles).max(axis=-1).min(axis=1)
    np.testing.assert_allclose(gap, 0.0, atol=1e-4)


@pytest.mark.slow
def test_the_actor_learns_the_held_poses_and_keeps_the_rest(built, monkeypatch):
    monkeypatch.setattr(action_regression, "_MINIBATCH", 64)
    monkeypatch.setattr(slope_warm_start, "_HELD", 3)
    task, learner = built
    policy = first_policy(learner)
    log: list[str] = []
    slope_warm_start.warm_start_on_slopes(learner, task.world, policy, KEY, log.append)
    after, before, flat, slope = (float(word) for word in log[-1].split() if word[0].isdigit())
    assert after < 0.6 * before
    assert flat < after
    assert slope < before
