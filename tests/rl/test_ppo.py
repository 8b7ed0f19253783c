from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from numpy.testing import assert_allclose

from getup_jax.networks import gaussian
from getup_jax.rl import ppo
from getup_jax.rl.ppo import ActorTerms, Samples

N, K, A = 64, 3, 4
CLIP = 0.2


def _ratio_and_advantage(seed: int = 0):
    rng = np.random.default_rng(seed)
    ratio = np.exp(0.3 * rng.normal(size=N)).astype(np.float32)
    return ratio, rng.normal(size=(N, K)).astype(np.float32)


def _plain_ppo(ratio, advantage):
    """Schulman et al. 2017, equation 7, sample by sample."""
    total = 0.0
    for r, a in zip(ratio, advantage, strict=True):
        total += min(r * a, min(max(r, 1 - CLIP), 1 + CLIP) * a)
    return -total / len(ratio)


def test_policy_loss_by_hand():
    ratio = jnp.asarray([1.5, 1.5, 0.5, 0.5])
    advantage = jnp.asarray([[1.0], [-1.0], [1.0], [-1.0]])
    # min(1.5, 1.2), min(-1.5, -1.2), min(.5, .8), min(-.5, -.8)
    found = ppo.policy_loss(ratio, advantage, jnp.ones(1), CLIP)
    assert_allclose(found, -(1.2 - 1.5 + 0.5 - 0.8) / 4, rtol=1e-6)


def test_one_objective_is_plain_ppo():
    ratio, advantage = _ratio_and_advantage()
    found = ppo.policy_loss(jnp.asarray(ratio), jnp.asarray(advantage[:, :1]), jnp.ones(1), CLIP)
    assert_allclose(found, _plain_ppo(ratio, advantage[:, 0]), rtol=1e-5)


def test_objectives_are_clipped_before_they_are_summed():
    ratio, advantage = _ratio_and_advantage()
    weights = np.asarray([0.5, 0.3, 0.2], np.float32)
    found = float(ppo.policy_loss(ratio, advantage, jnp.asarray(weights), CLIP))
    separate = sum(w * _plain_ppo(ratio, advantage[:, k]) for k, w in enumerate(weights))
    summed_first = _plain_ppo(ratio, advantage @ weights)
    assert_allclose(found, separate, rtol=1e-5)
    assert abs(found - summed_first) > 1e-3


def test_equal_objectives_equal_one():
    ratio, advantage = _ratio_and_advantage()
    one = jnp.asarray(advantage[:, :1])
    same = jnp.repeat(one, K, axis=1)
    loss_one, gradient_one = jax.value_and_grad(ppo.policy_loss)(ratio, one, jnp.ones(1), CLIP)
    loss, gradient = jax.value_and_grad(ppo.policy_loss)(ratio, same, jnp.full(K, 1 / K), CLIP)
    assert_allclose(loss, loss_one, rtol=1e-5)
    assert_allclose(gradient, gradient_one, atol=1e-7)
    assert_allclose(ppo.value_loss(same, 2 * same), ppo.value_loss(one, 2 * one), rtol=1e-5)


def test_gradient_vanishes_where_clipped():
    ratio = jnp.asarray([1.5, 1.1])
    gradient = jax.grad(ppo.policy_loss)(ratio, jnp.ones((2, 1)), jnp.ones(1), CLIP)
    assert_allclose(gradient, [0.0, -0.5])


def test_losses_of_actor_and_critic_by_hand():
    assert float(ppo.value_loss(jnp.zeros((2, 1)), jnp.asarray([[1.0], [3.0]]))) == 5.0
    terms = ActorTerms(policy=jnp.float32(1.0), entropy=jnp.float32(2.0))
    assert_allclose(ppo.actor_loss(terms, 0.1), 1.0 - 0.2, rtol=1e-6)


def test_standardize_each_objective():
    x = np.random.default_rng(0).normal(size=(8, 16, K)) * [1.0, 100.0, 0.01] + [0.0, 5.0, -1.0]
    found = np.asarray(ppo.standardize(jnp.asarray(x, jnp.float32)))
    assert_allclose(found.mean((0, 1)), 0.0, atol=1e-5)
    assert_allclose(found.std((0, 1)), 1.0, rtol=1e-4)
    assert_allclose(found, (x - x.mean((0, 1))) / x.std((0, 1)), atol=1e-4)


def test_clip_fraction_by_hand():
    assert float(ppo.clip_fraction(jnp.asarray([0.7, 0.9, 1.1, 1.3]), CLIP)) == 0.5


def test_approx_kl_estimates_the_closed_form():
    std = jnp.full(A, 0.5)
    old, new = jnp.zeros(A), jnp.asarray([0.2, -0.1, 0.0, 0.1])
    action = 0.5 * np.random.default_rng(0).normal(size=(100_000, A)).astype(np.float32)
    log_ratio = gaussian.log_prob(action, new, std) - gaussian.log_prob(action, old, std)
    assert_allclose(ppo.approx_kl(log_ratio), gaussian.kl(old, std, new, std), rtol=0.02)
    assert float(ppo.approx_kl(jnp.zeros(5))) == 0.0


def test_explained_variance_by_hand():
    target = jnp.asarray([[0.0, 1.0], [2.0, 5.0]])
    assert_allclose(ppo.explained_variance(target, target), 1.0)
    assert_allclose(ppo.explained_variance(target + 7.0, target), 1.0)
    assert_allclose(ppo.explained_variance(jnp.zeros((2, 2)), target), 0.0)
    assert np.isnan(ppo.explained_variance(target, jnp.ones((2, 2))))


def test_terms_of_an_unchanged_policy():
    rng = np.random.default_rng(0)
    mean, action = rng.normal(size=(2, N, A)).astype(np.float32)
    std = jnp.full(A, 0.6)
    advantage, target = rng.normal(size=(2, N, K)).astype(np.float32)
    samples = Samples(
        observation=jnp.zeros((N, 1)),
        action=jnp.asarray(action),
        log_prob=gaussian.log_prob(action, mean, std),
        advantage=jnp.asarray(advantage),
        target=jnp.asarray(target),
    )
    weights = jnp.full(K, 1 / K)
    terms, metrics = ppo.actor_terms(mean, samples, std, weights, CLIP)
    # The ratio is 1: the surrogate is the mean advantage, and nothing has moved.
    assert_allclose(terms.policy, -advantage.mean(), atol=1e-6)
    assert_allclose(terms.entropy, gaussian.entropy(std))
    assert float(metrics["ppo/kl"]) == float(metrics["ppo/clip_fraction"]) == 0.0
