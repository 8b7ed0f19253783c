"""A policy of the flat plane is taught to stand on slopes."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest
from ground_samples import TERRAIN
from tiny_task import CONFIG, getups, neutral_prior

from compiled import first_policy
from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.envs.getup.build import assemble
from getup_jax.envs.getup.resets import region_pool
from getup_jax.imitation import action_regression, slope_warm_start
from getup_jax.physics.character import load_character
from getup_jax.rl.learner import make_learner

PPO = PPOConfig(num_envs=16, num_steps=8, minibatch_size=64)
TASK = dataclasses.replace(CONFIG.task, pool_size=96, stand_start=0.5)
KEY = jax.random.PRNGKey(0)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(region_pool, "cache_dir", lambda: tmp_path_factory.mktemp("starts"))
        character = load_character(CONFIG.physics)
        config = dataclasses.replace(CONFIG, task=TASK, terrain=TERRAIN)
        prior = neutral_prior(character)
        task = assemble(config, character, getups(character), prior, lambda text: None)
    return task, make_learner(task.environment, NetworkConfig((64,)), PPO, total_steps=1000)


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
