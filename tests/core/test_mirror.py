from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.core import mirror
from getup_jax.core.mirror import SignedPermutation


def test_a_worked_example():
    swap = SignedPermutation(np.array([1, 0, 2]), np.array([1.0, 1.0, -1.0]), np.array([0, 0, 5.0]))
    x = jnp.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(swap(x), [2, 1, 2])
    np.testing.assert_array_equal(swap.linear()(x), [2, 1, -3])
    np.testing.assert_array_equal(swap.unsigned()(x), [2, 1, 3])
    np.testing.assert_array_equal(swap.stacked(x), [[1, 2, 3], [2, 1, 2]])
    both = jnp.array([[1.0, 2.0, 3.0], [4.0, 6.0, 1.0]])  # whose second row is (6, 4, 4) mirrored
    np.testing.assert_array_equal(swap.averaged(both), [3.5, 3.0, 3.5])


@pytest.mark.parametrize(
    "image",
    [mirror.CURVE, mirror.latent(5), mirror.vectors([1, 0, 2], mirror.signed(mirror.QUATERNION))],
)
def test_twice_is_the_identity(image):
    x = np.random.default_rng(0).normal(size=(7, image.size)).astype(np.float32)
    assert not np.allclose(image(x), x)
    np.testing.assert_allclose(image(image(x)), x, atol=1e-6)


def test_rows_are_swapped_whole():
    image = mirror.vectors([1, 0], mirror.signed(mirror.POLAR))
    np.testing.assert_array_equal(image(np.arange(6.0)), [3, -4, 5, 0, -1, 2])


def test_rows_keep_their_offsets():
    image = mirror.vectors([0, 1], mirror.CURVE)
    x = np.array([1.0, 0.2, 2.0, 3.0, 0.4, 4.0])
    np.testing.assert_allclose(image(x), [1, np.pi - 0.2, 2, 3, np.pi - 0.4, 4], rtol=1e-6)


def test_parts_stay_in_their_places():
    image = mirror.concatenated([mirror.signed([-1.0]), mirror.CURVE, mirror.latent(2)])
    x = np.array([1.0, 2.0, 0.5, 3.0, 4.0, 5.0])
    np.testing.assert_allclose(image(x), [-1, 2, np.pi - 0.5, 3, 4, -5], rtol=1e-6)


def test_moments_are_those_of_the_samples_and_their_images():
    parts = [mirror.CURVE, mirror.vectors([1, 0], mirror.signed(mirror.AXIAL))]
    image = mirror.concatenated(parts)
    rng = np.random.default_rng(1)
    x = rng.normal(size=(500, image.size)) * rng.uniform(0.5, 2.0, image.size) + 0.7
    both = np.concatenate([x, image(x)])
    mean, variance = image.moments(x.mean(axis=0), x.var(axis=0))
    np.testing.assert_allclose(mean, both.mean(axis=0), atol=1e-6)
    np.testing.assert_allclose(variance, both.var(axis=0), rtol=1e-6)


def test_averaging_makes_any_function_equivariant_and_leaves_an_equivariant_one():
    image = mirror.vectors([1, 0], mirror.signed(mirror.POLAR))
    rng = np.random.default_rng(2)
    kernel, x = rng.normal(size=(6, 6)), jnp.asarray(rng.normal(size=(9, 6)))

    def averaged(x):
        return image.averaged(jnp.tanh(image.stacked(x) @ kernel))

    np.testing.assert_allclose(averaged(image(x)), image(averaged(x)), atol=1e-6)
    np.testing.assert_array_equal(image.averaged(2.0 * image.stacked(x)), 2.0 * x)
