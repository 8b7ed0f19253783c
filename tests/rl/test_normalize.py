from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.rl import normalize
from getup_jax.rl.normalize import Moments

# Means and standard deviations far apart, as heights, angles and velocities are.
MEAN = np.asarray([0.0, 1000.0, -3.0])
STD = np.asarray([1.0, 0.1, 30.0])


def _batches(count: int, size: int) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    drift = np.linspace(0.0, 1.0, count)
    return [(MEAN + STD * (rng.normal(size=(size, 3)) + d)).astype(np.float32) for d in drift]


def _assert_close(moments: Moments, mean: np.ndarray, variance: np.ndarray, rtol: float):
    error = np.abs(moments.mean - mean) / np.sqrt(variance)
    assert error.max() < rtol
    np.testing.assert_allclose(moments.variance, variance, rtol=rtol)


def test_two_batches_by_hand():
    moments = normalize.update(normalize.initial(1), jnp.asarray([[1.0], [3.0]]))
    np.testing.assert_allclose((moments.mean, moments.variance), [[2.0], [1.0]])
    moments = normalize.update(moments, jnp.asarray([[8.0]]))
    # 1, 3, 8: mean 4, variance (9 + 1 + 16) / 3.
    assert float(moments.count) == 3.0
    np.testing.assert_allclose((moments.mean, moments.variance), [[4.0], [26.0 / 3.0]], rtol=1e-6)


def test_matches_float64_numpy():
    batches = _batches(20, 512)
    moments = normalize.initial(3)
    for batch in batches:
        moments = normalize.update(moments, jnp.asarray(batch.reshape(16, 32, 3)))
    x = np.concatenate(batches).astype(np.float64)
    _assert_close(moments, x.mean(0), x.var(0), rtol=2e-3)


def test_far_past_the_integers_of_float32():
    # Start after 2^25 samples, where adding 1 no longer changes a float32, and double them.
    count, size, repeats = 2.0**25, 1000, 2**25 // 1000
    batch = _batches(2, size)[1]
    start = Moments(jnp.float32(count), jnp.float32(MEAN), jnp.zeros(3), jnp.float32(STD**2))
    moments = jax.jit(
        lambda m: jax.lax.fori_loop(0, repeats, lambda _, m: normalize.update(m, batch), m)
    )(start)
    x = batch.astype(np.float64)
    share = size * repeats / (count + size * repeats)
    gap = x.mean(0) - np.float64(np.float32(MEAN))
    mean = MEAN + share * gap
    variance = (1 - share) * STD**2 + share * x.var(0) + share * (1 - share) * gap**2
    np.testing.assert_allclose(moments.count, count + size * repeats, rtol=1e-3)
    _assert_close(moments, mean, variance, rtol=2e-3)


def test_merge_is_symmetric_and_matches_update():
    a, b = (normalize.update(normalize.initial(3), jnp.asarray(x)) for x in _batches(2, 100))
    one, other = normalize.merge(a, b), normalize.merge(b, a)
    _assert_close(one, np.asarray(other.mean), np.asarray(other.variance), rtol=1e-3)
    updated = normalize.update(a, jnp.asarray(_batches(2, 100)[1]))
    _assert_close(updated, np.asarray(one.mean), np.asarray(one.variance), rtol=1e-3)


def test_normalized_batch_is_standard_and_clipped():
    x = _batches(1, 4096)[0]
    moments = normalize.update(normalize.initial(3), jnp.asarray(x))
    z = np.asarray(normalize.normalize(moments, jnp.asarray(x)))
    np.testing.assert_allclose(z.mean(0), 0.0, atol=2e-3)
    np.testing.assert_allclose(z.std(0), 1.0, rtol=2e-3)
    far = normalize.normalize(moments, jnp.asarray(MEAN + 1e3 * STD))
    np.testing.assert_array_equal(far, normalize.CLIP)


def test_no_samples_leave_observations_alone():
    x = jnp.asarray([[0.5, -9.0, 2.0]])
    np.testing.assert_allclose(normalize.normalize(normalize.initial(3), x), x, rtol=1e-5)


def test_constant_observation_gives_zero():
    x = jnp.full((64, 3), 0.1)
    moments = normalize.update(normalize.initial(3), x)
    np.testing.assert_allclose(normalize.normalize(moments, x), 0.0, atol=1e-3)


def test_a_least_std_keeps_small_variations_small():
    moments = normalize.moments_of(jnp.asarray([[0.0, -0.01], [4.0, 0.01]]), jnp.zeros(2))
    found = normalize.normalize(moments, jnp.asarray([[4.0, 0.01]]), least_std=0.1)
    np.testing.assert_allclose(found, [[1.0, 0.1]], rtol=1e-3)


def test_a_horizon_follows_what_comes_later():
    rng = np.random.default_rng(1)
    early, late = (rng.normal(size=(40, 500, 1)).astype(np.float32) + m for m in (0.0, 5.0))
    forgetful = cumulative = normalize.initial(1)
    for batch in (*early, *late):
        forgetful = normalize.update(forgetful, jnp.asarray(batch), horizon=2000.0)
        cumulative = normalize.update(cumulative, jnp.asarray(batch))
    assert float(forgetful.count) == 2500.0
    np.testing.assert_allclose(cumulative.mean, 2.5, atol=0.1)
    # a fifth of what it knows is new in every batch: .8^40 of the early ones is left
    np.testing.assert_allclose(forgetful.mean, 5.0 * (1 - 0.8**40), atol=0.1)
    np.testing.assert_allclose(forgetful.variance, 1.0, rtol=0.1)


def test_a_horizon_changes_nothing_before_it_is_reached():
    batch = jnp.asarray(np.random.default_rng(2).normal(size=(100, 3)), jnp.float32)
    one = normalize.update(normalize.update(normalize.initial(3), batch), batch, horizon=1000.0)
    other = normalize.update(normalize.update(normalize.initial(3), batch), batch)
    np.testing.assert_array_equal(one.mean, other.mean)
    np.testing.assert_array_equal(one.variance, other.variance)
