from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.networks import gaussian
from getup_jax.rl.learner import make_learner
from getup_jax.rl.policy_update import Improver, cosine
from getup_jax.rl.ppo import Samples
from probes import Probe

STEPS, ENVS = 8, 16
CONFIG = PPOConfig(num_envs=ENVS, num_steps=STEPS, epochs=1, critic_epochs=3, minibatch_size=32)
LEARNER = make_learner(Probe(), NetworkConfig(hidden_sizes=(8,)), CONFIG, 1000)
STD = jnp.full(1, 0.5)


@pytest.fixture(scope="module")
def improver() -> Improver:
    return LEARNER.improver


def _samples(learner, noise: float, seed: int = 0) -> Samples:
    """Actions around the mean whose advantage is their own offset, and noise."""
    rng = np.random.default_rng(seed)
    observation = jnp.asarray(rng.normal(size=(STEPS * ENVS, 2)), jnp.float32)
    mean = LEARNER.model.mean(learner.policy.actor, observation)
    offset = jnp.asarray(0.5 * rng.normal(size=mean.shape), jnp.float32)
    advantage = offset + noise * jnp.asarray(rng.normal(size=mean.shape), jnp.float32)
    return Samples(
        observation=observation,
        action=mean + offset,
        log_prob=gaussian.log_prob(mean + offset, mean, STD),
        advantage=advantage,
        target=jnp.ones((STEPS * ENVS, 1)),
    )


def _same(one, other) -> bool:
    pairs = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return all(bool((a == b).all()) for a, b in pairs)


def test_actor_and_critic_leave_each_other_alone(improver: Improver):
    learner = jax.jit(LEARNER.init_learner)(jax.random.key(0))
    samples, rate, key = _samples(learner, 0.0), jnp.asarray(1e-2), jax.random.key(1)
    acted, valued, metrics = improver.update(learner, samples, (rate, rate), STD, key)
    assert _same(acted.critic, learner.critic)
    assert _same(acted.critic_optimiser, learner.critic_optimiser)
    assert not _same(acted.policy.actor, learner.policy.actor)
    assert _same(valued.policy, learner.policy)
    assert _same(valued.actor_optimiser, learner.actor_optimiser)
    assert not _same(valued.critic, learner.critic)
    assert {"loss/value", "ppo/critic_gradient_norm", "ppo/gradient_norm"} < set(metrics)
    other, _, _ = improver.update(learner, samples, (rate, 0.5 * rate), STD, key)
    assert _same(other.policy, acted.policy)


def test_each_has_its_number_of_epochs(improver: Improver):
    learner = jax.jit(LEARNER.init_learner)(jax.random.key(0))
    samples, rate, key = _samples(learner, 0.0), jnp.asarray(1e-3), jax.random.key(1)
    acted, valued, _ = improver.update(learner, samples, (rate, rate), STD, key)
    updates = STEPS * ENVS // 32
    assert int(acted.actor_optimiser[1].count) == updates
    assert int(valued.critic_optimiser[1].count) == 3 * updates


def test_cosine_by_hand():
    a = {"x": jnp.asarray([3.0, 0.0]), "y": jnp.asarray(4.0)}
    b = {"x": jnp.asarray([0.0, 2.0]), "y": jnp.asarray(0.0)}
    assert_allclose(cosine(a, a), 1.0, rtol=1e-6)
    assert_allclose(cosine(a, jax.tree.map(lambda x: -2.0 * x, a)), -1.0, rtol=1e-6)
    assert_array_equal(cosine(a, b), 0.0)
    assert np.isnan(cosine(a, jax.tree.map(jnp.zeros_like, a)))


def test_the_gradients_cosine_tells_signal_from_noise(improver: Improver):
    learner = jax.jit(LEARNER.init_learner)(jax.random.key(0))
    actor = learner.policy.actor
    clear = improver.gradient_cosine(actor, _samples(learner, 0.0), STD)
    assert float(clear) > 0.9
    noisy = [
        float(improver.gradient_cosine(actor, _samples(learner, 1000.0, seed), STD))
        for seed in range(8)
    ]
    assert abs(np.mean(noisy)) < 0.4
