from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.core.mirror import CURVE, POLAR, QUATERNION, concatenated, signed, vectors
from getup_jax.networks.equivariant import EquivariantMLP, dense, joined, parts, sizes
from getup_jax.networks.mlp import MLP

SEEN = concatenated([vectors([1, 0], signed(POLAR)), CURVE, signed(QUATERNION)])
DONE = concatenated([vectors([1, 0, 2], signed([1.0, -1.0])), signed([1.0])])
X = jnp.asarray(np.random.default_rng(0).normal(size=(20, SEEN.size)), jnp.float32)


def make(hidden: tuple[int, ...] = (32, 15), image=DONE) -> tuple[EquivariantMLP, dict]:
    """A network with biases that are not 0."""
    net = EquivariantMLP(hidden, SEEN, image, "elu")
    variables = net.init(jax.random.PRNGKey(0), X[0])
    return net, jax.tree.map(
        lambda x: x + 0.1 * jnp.cos(jnp.arange(x.size)).reshape(x.shape), variables
    )


@pytest.mark.parametrize("hidden", [(), (32, 15)])
def test_the_image_of_the_output_is_the_output_of_the_image(hidden):
    net, variables = make(hidden)
    out, image = net.apply(variables, X), net.apply(variables, SEEN(X))
    assert out.shape == (20, DONE.size)
    assert np.abs(out - DONE(out)).max() > 0.1
    np.testing.assert_allclose(image, DONE(out), rtol=1e-5, atol=1e-5)


def test_outputs_that_stay_have_no_antisymmetric_part():
    net, variables = make(image=signed([1.0, 1.0]))
    assert "output_odd" not in variables["params"]
    np.testing.assert_allclose(
        net.apply(variables, SEEN(X)), net.apply(variables, X), rtol=1e-5, atol=1e-5
    )


def test_it_can_be_any_equivariant_function_of_one_layer():
    rng = np.random.default_rng(1)
    kernel = rng.normal(size=(SEEN.size, DONE.size)).astype(np.float32)
    about = X - 0.5 * SEEN.offset
    linear = SEEN.linear()
    wanted = 0.5 * (about @ kernel + DONE(linear(about) @ kernel))
    net = EquivariantMLP((), SEEN, DONE)
    even, odd = parts(linear, about)
    wanted_even, wanted_odd = parts(DONE, wanted)
    fitted = {
        "output": {
            "kernel": jnp.linalg.lstsq(even, wanted_even)[0],
            "bias": jnp.zeros(wanted_even.shape[-1]),
        },
        "output_odd": {"kernel": jnp.linalg.lstsq(odd, wanted_odd)[0]},
    }
    np.testing.assert_allclose(net.apply({"params": fitted}, X), wanted, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("image", [SEEN.linear(), DONE])
def test_parts_are_orthonormal_coordinates_of_what_stays_and_what_turns(image):
    x = X[:, : image.size]
    even, odd = parts(image, x)
    assert (even.shape[-1], odd.shape[-1]) == sizes(image)
    assert even.shape[-1] + odd.shape[-1] == image.size
    np.testing.assert_allclose(joined(image, even, odd), x, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(joined(image, even, -odd), image(x), rtol=1e-5, atol=1e-6)
    both = jnp.concatenate([even, odd], axis=-1)
    np.testing.assert_allclose((both**2).sum(-1), (x**2).sum(-1), rtol=1e-5)


def test_the_kernels_are_half_of_a_dense_networks():
    _, variables = make((32, 16))
    kernels = sum(x.size for x in jax.tree.leaves(variables) if x.ndim == 2)
    evens, odds = sizes(DONE)
    assert evens + odds == DONE.size
    assert kernels == 16 * SEEN.size + 2 * 16 * 16 // 2 + 8 * DONE.size


@pytest.mark.parametrize(("hidden", "image"), [((), signed([1.0, 1.0])), ((32, 16), DONE)])
def test_a_dense_network_can_do_the_same(hidden, image):
    net, variables = make(hidden, image)
    mlp = MLP(hidden, image.size, "elu")
    expanded = jax.jit(functools.partial(dense, net))(variables)
    shapes = jax.eval_shape(mlp.init, jax.random.PRNGKey(1), X[0])
    assert jax.tree.map(np.shape, expanded) == jax.tree.map(np.shape, shapes)
    outputs = jax.jit(mlp.apply)(expanded, X), jax.jit(net.apply)(variables, X)
    np.testing.assert_allclose(*outputs, atol=2e-5)


def test_one_with_an_odd_size_has_no_dense_one_of_that_size():
    net, variables = make((32, 15))
    with pytest.raises(ValueError, match=r"hidden_sizes: expected even ones, got \(32, 15\)"):
        dense(net, variables)
