"""One policy on two engines."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import CONFIG, tiny_task

from compiled import first_policy
from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.networks.mlp import OUTPUT_LAYER
from getup_jax.rl.learner import make_learner


@pytest.mark.slow  # tests/physics/test_mjx.py compares the engines themselves
def test_a_policys_first_actions_are_the_same_on_native_and_mjx(character, built):
    physics = dataclasses.replace(CONFIG.physics, engine="mjx")
    other = tiny_task(character, dataclasses.replace(CONFIG, physics=physics))
    kind, getup, row = jnp.arange(6) % 3, jnp.arange(6) % 2, jnp.arange(6) % 4
    learner = make_learner(built.environment, NetworkConfig(), PPOConfig(), total_steps=1)
    policy = first_policy(learner)
    # at first all actions are near zero; a trained policy's are not
    output = policy.actor["params"][OUTPUT_LAYER]
    output["kernel"] = 100.0 * output["kernel"]
    actions = [
        learner.act(
            policy, jax.jit(task.environment.start)(task.world, getup, kind, row).observation
        )
        for task in (built, other)
    ]
    assert np.abs(actions[0]).max() > 1.0
    np.testing.assert_allclose(actions[0], actions[1], atol=1e-4)
