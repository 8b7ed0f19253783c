from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from getup_jax.rl.minibatch import (
    ACTOR_EPSILON,
    FIRST_SCALE,
    Trainee,
    adapt_scale,
    first_scale,
    make_optimiser,
    run_minibatches,
    shuffled_minibatches,
)


def test_every_epoch_is_a_fresh_permutation():
    rows = np.asarray(shuffled_minibatches(jax.random.key(0), 3, 24, 8))
    assert rows.shape == (9, 8)
    epochs = rows.reshape(3, 24)
    np.testing.assert_array_equal(np.sort(epochs, axis=1), np.tile(np.arange(24), (3, 1)))
    assert (epochs[0] != epochs[1]).any()
    assert (epochs[1] != epochs[2]).any()


def _loss(parameter, minibatch):
    error = jnp.mean(jnp.square(parameter - minibatch))
    return error, {"error": error}


def _slow_adam(parameter, x, rows, rate, max_norm):
    """Kingma and Ba 2015, algorithm 1, on the clipped gradient of the mean squared error."""
    m = v = 0.0
    errors, norms = [], []
    for step, row in enumerate(rows, start=1):
        errors.append(np.mean(np.square(parameter - x[row])))
        gradient = 2.0 * np.mean(parameter - x[row])
        norms.append(abs(gradient))
        gradient *= min(1.0, max_norm / abs(gradient))
        m = 0.9 * m + 0.1 * gradient
        v = 0.999 * v + 0.001 * gradient**2
        root = np.sqrt(v / (1 - 0.999**step))
        parameter -= rate * (m / (1 - 0.9**step)) / (root + ACTOR_EPSILON)
    return parameter, np.mean(errors), np.mean(norms)


@pytest.mark.parametrize("max_norm", [0.5, 100.0])
def test_updates_match_slow_adam(max_norm: float):
    x = np.random.default_rng(0).normal(size=40).astype(np.float32) + 3.0
    rows = np.asarray(shuffled_minibatches(jax.random.key(0), 2, 40, 10))
    optimiser = make_optimiser(max_norm, jnp.asarray(0.1), ACTOR_EPSILON)
    start = jnp.zeros(())
    trainee = Trainee(_loss, optimiser, start, optimiser.init(start), jnp.asarray(rows))
    ((parameter, state, metrics),) = run_minibatches((trainee,), jnp.asarray(x))
    expected, error, norm = _slow_adam(0.0, x, rows, 0.1, max_norm)
    assert_allclose(parameter, expected, rtol=1e-4)
    assert_allclose(metrics["error"], error, rtol=1e-4)
    assert_allclose(metrics["gradient_norm"], norm, rtol=1e-4)
    fresh = make_optimiser(1.0, 0.0, ACTOR_EPSILON).init(start)
    assert jax.tree.structure(state) == jax.tree.structure(fresh)


def test_side_by_side_each_learns_what_it_does_alone():
    x = jnp.asarray(np.random.default_rng(0).normal(size=40), jnp.float32)
    optimiser = make_optimiser(1.0, jnp.asarray(0.1), ACTOR_EPSILON)
    trainees = [
        Trainee(
            _loss,
            optimiser,
            jnp.asarray(start),
            optimiser.init(jnp.asarray(start)),
            shuffled_minibatches(jax.random.key(epochs), epochs, 40, 10),
        )
        for start, epochs in ((0.0, 3), (5.0, 1), (-2.0, 2))
    ]
    together = run_minibatches(trainees, x)
    for trainee, found in zip(trainees, together, strict=True):
        (alone,) = run_minibatches((trainee,), x)
        jax.tree.map(lambda a, b: assert_allclose(a, b, rtol=1e-6), found, alone)


@pytest.mark.parametrize(
    ("clip_fraction", "factor"),
    [(0.15, 1.0), (0.30, 1 / 1.2), (0.40, 1 / 1.5), (0.10, 1.2), (0.05, 1.5)],
)
def test_scale_follows_the_clip_fraction(clip_fraction: float, factor: float):
    scale = adapt_scale(jnp.asarray(0.5), jnp.asarray(clip_fraction), 0.15)
    assert_allclose(scale, 0.5 * factor, rtol=1e-6)


def test_scale_stays_without_a_target():
    assert_allclose(adapt_scale(jnp.ones(()), jnp.asarray(0.30), None), 1.0)
    assert float(first_scale(None)) == 1.0


def test_scale_never_passes_the_schedule():
    scale = first_scale(0.15)
    assert_allclose(scale, FIRST_SCALE)
    for _ in range(40):
        scale = adapt_scale(scale, jnp.asarray(0.0), 0.15)
    assert_allclose(scale, 1.0)
    for _ in range(80):
        scale = adapt_scale(scale, jnp.asarray(0.9), 0.15)
    assert_allclose(scale, 1e-3)
