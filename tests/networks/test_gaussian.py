from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from scipy import stats

from getup_jax.networks import gaussian

STD = np.asarray([0.5, 1.0, 2.0], np.float32)


def _points(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(4, 3)).astype(np.float32)


def test_log_prob_by_hand():
    # Two standard deviations off in one of two unit directions: -2 - log(2 pi).
    found = gaussian.log_prob(jnp.asarray([2.0, 0.0]), jnp.zeros(2), jnp.ones(2))
    np.testing.assert_allclose(found, -2.0 - np.log(2.0 * np.pi), rtol=1e-6)


def test_log_prob_matches_scipy():
    x, mean = _points(0), _points(1)
    expected = stats.norm.logpdf(x, mean, STD).sum(-1)
    np.testing.assert_allclose(gaussian.log_prob(x, mean, STD), expected, rtol=1e-5)


def test_entropy_matches_scipy():
    expected = stats.norm.entropy(0.0, STD).sum()
    np.testing.assert_allclose(gaussian.entropy(jnp.asarray(STD)), expected, rtol=1e-6)


def test_sample_has_its_mean_and_std():
    mean = np.broadcast_to(np.asarray([1.0, -2.0, 0.0], np.float32), (20_000, 3))
    x = gaussian.sample(jax.random.key(0), jnp.asarray(mean), jnp.asarray(STD))
    np.testing.assert_allclose(x.mean(0), mean[0], atol=0.05)
    np.testing.assert_allclose(x.std(0), STD, rtol=0.03)


def test_kl_of_one_std_is_the_scaled_distance():
    p, q = _points(0), _points(1)
    expected = (np.square(p - q) / (2.0 * STD**2)).sum(-1)
    np.testing.assert_allclose(gaussian.kl(p, STD, q, STD), expected, rtol=1e-5)


def test_kl_is_the_mean_log_ratio():
    p, q, std_q = _points(0)[0], _points(1)[0], 1.5 * STD
    x = p + STD * np.random.default_rng(2).normal(size=(200_000, 3)).astype(np.float32)
    sampled = jnp.mean(gaussian.log_prob(x, p, STD) - gaussian.log_prob(x, q, std_q))
    np.testing.assert_allclose(gaussian.kl(p, STD, q, std_q), sampled, rtol=0.02)
    np.testing.assert_allclose(gaussian.kl(p, STD, p, STD), 0.0, atol=1e-6)
