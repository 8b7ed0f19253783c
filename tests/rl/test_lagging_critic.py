"""A critic that lags turns the policy's gradient round; one with a rate of its own does not.

Every step pays 1, and a negative action ends the episode with BONUS at once. Going on for ever is
worth 1 / (1 - discount), far more than BONUS. But to a critic that still believes in 0, going on
looks worth 1 and the end BONUS: advantages of short rollouts are then of the wrong sign.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import struct

from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.core.types import StepOutput
from getup_jax.rl.learner import make_learner

BONUS = 4.0
DISCOUNT = 0.95


@struct.dataclass
class StayState:
    observation: jax.Array  # [B, 1] ones


@dataclasses.dataclass(frozen=True)
class Stay:
    """See the module."""

    observation_size: int = 1
    action_size: int = 1
    num_objectives: int = 1

    def init(self, world: None, key: jax.Array, num_envs: int) -> StayState:
        return StayState(jnp.ones((num_envs, 1)))

    def step(self, world: None, state: StayState, action: jax.Array):
        ended = action[:, 0] < 0.0
        output = StepOutput(
            observation=state.observation,
            final_observation=state.observation,
            reward=jnp.where(ended, BONUS, 1.0)[:, None],
            terminated=ended,
            truncated=jnp.zeros_like(ended),
            metrics={},
            episode={},
        )
        return state, output


def _share_that_stays(critic_rate: float, num_steps: int) -> float:
    """Of the noisy actions, after training from one half."""
    config = PPOConfig(
        num_envs=64,
        num_steps=num_steps,
        epochs=2,
        critic_epochs=2,
        minibatch_size=64,
        discount=DISCOUNT,
        learning_rate=(3e-3, 3e-3),
        critic_learning_rate=(critic_rate, critic_rate),
        action_std=(0.5, 0.5),
        normalize_observation=False,
    )
    learner = make_learner(Stay(), NetworkConfig(hidden_sizes=(8,)), config, 100_000)
    iterate = jax.jit(learner.iteration)
    state = jax.jit(learner.init)(None, jax.random.key(0))
    for _ in range(100):
        state, _ = iterate(None, state)
    mean = float(learner.act(state.learner.policy, jnp.ones((1, 1)))[0, 0])
    noise = 0.5 * np.random.default_rng(0).normal(size=10_000)
    return float(np.mean(mean + noise > 0.0))


def test_a_critic_that_lags_behind_teaches_the_wrong_action():
    assert _share_that_stays(critic_rate=1e-6, num_steps=2) < 0.1


@pytest.mark.parametrize("num_steps", [2, 16])
def test_a_critic_with_a_rate_of_its_own_teaches_the_right_one(num_steps: int):
    assert _share_that_stays(critic_rate=3e-2, num_steps=num_steps) > 0.9


def test_long_rollouts_help_a_critic_that_lags():
    long, short = (_share_that_stays(critic_rate=1e-3, num_steps=n) for n in (32, 2))
    assert long > short + 0.2
