from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tiny_composite import COMPOSITE, CONFIG, tiny_composite

from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.envs.composite.discriminator_rewards import (
    DiscriminatorRewards,
    make_discriminator_rewards,
)
from getup_jax.physics.character import load_character
from getup_jax.rl.discriminator import Discriminator
from getup_jax.rl.learner import Learner, make_learner
from probes import Probe, make_world

# what users run: with the quick options of conftest.py two programs may round differently
AS_USERS = {"xla_backend_optimization_level": 3, "xla_cpu_use_fusion_emitters": True}
PROBE_PPO = PPOConfig(num_envs=16, num_steps=8, minibatch_size=32, popart=True)


def _objectives(separate: bool = True, weights=(1.0,), names=("goal",)) -> DiscriminatorRewards:
    """DiscriminatorRewards without an imitation: all rewards are the environment's."""
    return DiscriminatorRewards(
        names, weights, (), Discriminator(COMPOSITE.discriminator), 1 / 30, separate
    )


def _train(learner: Learner, iterations: int = 5):
    world = make_world(by_action=1.0, action_mean=0.5, length=3, truncates=True)
    state = jax.jit(learner.init)(world, jax.random.key(0))
    options = AS_USERS if jax.default_backend() == "cpu" else None
    step = jax.jit(learner.iteration, donate_argnums=1, compiler_options=options)
    for _ in range(iterations):
        state, metrics = step(world, state)
    return state, metrics


NETWORK = NetworkConfig(hidden_sizes=(16,), activation="tanh")


@pytest.fixture(scope="module")
def plain():
    """State and metrics of plain PPO."""
    return _train(make_learner(Probe(), NETWORK, PROBE_PPO, 10_000))


@pytest.mark.parametrize("separate", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_one_objective_with_one_reward_is_plain_ppo_bit_for_bit(plain, separate: bool):
    rewards = _objectives(separate)
    composite = make_learner(Probe(), NETWORK, PROBE_PPO, 10_000, reward_model=rewards)
    expected, metrics = plain
    found, same = _train(composite)
    assert found.learner.discriminators == {}
    learner = dataclasses.replace(found.learner, discriminators=None)
    found = dataclasses.replace(found, learner=learner)
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        assert_array_equal(_plain(a), _plain(b))
    assert all(same[name] == value for name, value in metrics.items() if not jnp.isnan(value))


def _is_key(x) -> bool:
    return jnp.issubdtype(x.dtype, jax.dtypes.prng_key)


def _plain(x):
    return jax.random.key_data(x) if _is_key(x) else x


@pytest.fixture(scope="module")
def built():
    return tiny_composite(load_character(CONFIG.physics))


@pytest.fixture(scope="module")
def judged(built):
    """A hand-made rollout of real windows, judged once."""
    env, world = built.environment, jax.device_put(built.world)
    objectives = make_discriminator_rewards(env, COMPOSITE)

    def run(key):
        states = objectives.init(key)
        env_state = jax.jit(env.init, static_argnums=2)(world, key, 8)

        def step(state, _):
            state, output = env.step(world, state, jnp.full((8, 28), 0.05))
            return state, output

        _, output = jax.lax.scan(step, env_state, None, length=4)
        transition = _transition(output)
        return transition, *objectives.score(world, states, transition, key)

    return objectives, world, jax.jit(run)(jax.random.key(0))


def _transition(output):
    from getup_jax.rl.rollout import Transition

    terminated = output.terminated.at[0, 0].set(True)
    reward = jnp.where(terminated[..., None], -1.0, output.reward)
    zeros = jnp.zeros(output.reward.shape[:2])
    return Transition(
        output.observation,
        zeros,
        zeros,
        reward,
        terminated,
        output.truncated,
        output.final_observation,
        output.extras,
    )


def test_every_step_gets_the_score_of_the_trained_discriminator(judged):
    objectives, _, (before, states, after, metrics) = judged
    assert after.reward.shape == (4, 8, 2)
    score = jax.jit(objectives.discriminator.score)
    for index, group in enumerate(objectives.groups):
        expected = score(states[group.name], before.extras[group.name])
        expected = np.where(before.terminated, -1.0, expected)
        assert_allclose(after.reward[..., index], expected, atol=1e-5)
        assert_allclose(metrics[f"rollout/reward_{group.name}"], expected.mean(), atol=1e-5)
        assert np.isfinite(metrics[f"discriminator_{group.name}/loss"])
    assert after.reward[0, 0].tolist() == [-1.0, -1.0]


def test_one_critic_gets_the_weighted_sum(judged):
    objectives, _, (_, _, after, _) = judged
    summed = dataclasses.replace(objectives, separate=False, weights=(0.25, 0.75))
    assert summed.critic_weights == (1.0,)
    rewards = np.asarray(after.reward)
    found = summed._merged(after.reward)
    assert_allclose(found[..., 0], 0.25 * rewards[..., 0] + 0.75 * rewards[..., 1], atol=1e-6)


def test_a_share_of_the_windows_is_drawn_without_repeats(judged):
    objectives, _, _ = judged
    half = dataclasses.replace(COMPOSITE.discriminator, share=0.5)
    some = dataclasses.replace(objectives, discriminator=Discriminator(half))
    windows = jnp.arange(32.0)[:, None, None]
    found = np.asarray(some._some(windows, jax.random.key(0))).ravel()
    assert len(set(found)) == 16
    assert set(found) != set(range(16))
    assert objectives._some(windows, jax.random.key(0)) is windows
