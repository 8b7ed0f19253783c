"""A small task on irregular ground, and a learner of it."""

from __future__ import annotations

import dataclasses

import pytest
from ground_samples import TERRAIN
from tiny_task import CONFIG, getups, neutral_prior

from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.envs.getup.build import assemble
from getup_jax.envs.getup.resets import region_pool
from getup_jax.physics.character import load_character
from getup_jax.rl.learner import make_learner

PPO = PPOConfig(num_envs=16, num_steps=8, minibatch_size=64)
TASK = dataclasses.replace(CONFIG.task, pool_size=96, stand_start=0.5)


@pytest.fixture(scope="session")
def built(tmp_path_factory):
    """All regions are open."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(region_pool, "cache_dir", lambda: tmp_path_factory.mktemp("starts"))
        character = load_character(CONFIG.physics)
        terrain = dataclasses.replace(TERRAIN, curriculum="none")
        config = dataclasses.replace(CONFIG, task=TASK, terrain=terrain)
        prior = neutral_prior(character)
        task = assemble(config, character, getups(character), prior, lambda text: None)
    return task, make_learner(task.environment, NetworkConfig((64,)), PPO, total_steps=1000)
