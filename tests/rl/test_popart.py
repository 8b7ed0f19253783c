from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from getup_jax.networks.mlp import MLP
from getup_jax.rl import popart
from getup_jax.rl.popart import MOMENTUM, PopArt

MEAN = np.asarray([0.0, 1000.0, -3.0])
STD = np.asarray([1.0, 0.1, 30.0])


CRITIC = MLP((16,), 3)
INPUTS = np.random.default_rng(9).normal(size=(100, 4)).astype(np.float32)


@pytest.fixture(scope="module")
def variables() -> dict:
    return jax.jit(CRITIC.init)(jax.random.key(0), INPUTS)


def _targets(seed: int, shift: float = 0.0) -> jax.Array:
    noise = np.random.default_rng(seed).normal(size=(16, 64, 3)) + shift
    return jnp.asarray(MEAN + STD * noise, jnp.float32)


def test_first_batch_counts_in_full():
    target = _targets(0)
    statistics = popart.update(popart.initial(3), target)
    x = np.asarray(target, np.float64)
    np.testing.assert_allclose(statistics.mean, x.mean((0, 1)), rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(statistics.std, x.std((0, 1)), rtol=1e-3)


def test_matches_debiased_averages_of_both_moments():
    statistics = popart.initial(3)
    first = second = weight = 0.0
    for seed in range(7):
        target = _targets(seed, shift=0.5 * seed)
        statistics = popart.update(statistics, target)
        x = np.asarray(target, np.float64)
        first = (1 - MOMENTUM) * first + MOMENTUM * x.mean((0, 1))
        second = (1 - MOMENTUM) * second + MOMENTUM * np.square(x).mean((0, 1))
        weight = (1 - MOMENTUM) * weight + MOMENTUM
    mean = first / weight
    std = np.sqrt(second / weight - mean**2)
    assert np.max(np.abs(statistics.mean - mean) / std) < 2e-3
    np.testing.assert_allclose(statistics.std, std, rtol=2e-3)


def test_rescaling_preserves_every_value(variables: dict):
    statistics = popart.initial(3)
    before = popart.denormalize(statistics, CRITIC.apply(variables, INPUTS))
    for seed in range(5):
        moved = popart.update(statistics, _targets(seed, shift=seed))
        variables, statistics = popart.rescale(variables, statistics, moved), moved
        after = popart.denormalize(statistics, CRITIC.apply(variables, INPUTS))
        # To float32's last digits of the numbers that are added.
        scale = np.abs(statistics.mean) + np.abs(before) + 1.0
        assert np.max(np.abs(after - before) / scale) < 1e-5


def test_rescaling_touches_the_last_layer_only(variables: dict):
    old = popart.initial(3)
    moved = popart.rescale(variables, old, popart.update(old, _targets(0)))
    hidden, output = (moved["params"][name] for name in ("hidden_0", "output"))
    np.testing.assert_array_equal(hidden["kernel"], variables["params"]["hidden_0"]["kernel"])
    assert jax.tree.structure(moved) == jax.tree.structure(variables)
    assert not np.allclose(output["kernel"], variables["params"]["output"]["kernel"])


def test_normalize_and_back():
    statistics = popart.update(popart.initial(3), _targets(0))
    target = _targets(1)
    back = popart.denormalize(statistics, popart.normalize(statistics, target))
    np.testing.assert_allclose(back, target, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(popart.normalize(statistics, target).std((0, 1)), 1.0, rtol=0.1)


def test_constant_target_stays_finite():
    statistics = popart.update(popart.initial(1), jnp.full((8, 1), 5.0))
    assert isinstance(statistics, PopArt)
    np.testing.assert_allclose(statistics.std, popart.MIN_STD)
    np.testing.assert_allclose(popart.normalize(statistics, jnp.full((8, 1), 5.0)), 0.0, atol=1e-2)


def test_moments_of_the_last_layer_move_as_its_gradients_do(variables: dict):
    adam = optax.scale_by_adam()
    old = popart.initial(3)
    new = popart.update(old, _targets(0))
    target = _targets(1).reshape(-1, 3)[:100]

    def gradient(variables: dict, statistics: PopArt):
        def loss(variables: dict):
            miss = CRITIC.apply(variables, INPUTS) - popart.normalize(statistics, target)
            return jnp.mean(jnp.square(miss))

        return jax.grad(loss)(variables)

    before = adam.update(gradient(variables, old), adam.init(variables))[1]
    moved = popart.rescale(variables, old, new)
    expected = adam.update(gradient(moved, new), adam.init(variables))[1]
    found = popart.rescale_moments(before, old, new)
    for name in ("kernel", "bias"):
        for moment in ("mu", "nu"):
            one, other = (getattr(s, moment)["params"]["output"][name] for s in (found, expected))
            np.testing.assert_allclose(one, other, rtol=2e-3, atol=1e-6)
    hidden = (s.mu["params"]["hidden_0"]["kernel"] for s in (found, before))
    np.testing.assert_array_equal(*hidden)
