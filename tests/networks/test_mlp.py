from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import NetworkConfig
from getup_jax.networks.mlp import ACTIVATIONS, MLP, OUTPUT_LAYER

INPUTS = 6


def _init(net: MLP) -> dict:
    return jax.jit(net.init)(jax.random.key(0), jnp.zeros(INPUTS))


def test_forward_matches_numpy():
    net = MLP((8, 5), 3, activation="tanh")
    variables = _init(net)
    x = np.random.default_rng(0).normal(size=(2, 4, INPUTS)).astype(np.float32)
    layers = jax.tree.map(np.asarray, variables["params"])
    h = x
    for name in ("hidden_0", "hidden_1"):
        h = np.tanh(h @ layers[name]["kernel"] + layers[name]["bias"])
    expected = h @ layers[OUTPUT_LAYER]["kernel"] + layers[OUTPUT_LAYER]["bias"]
    np.testing.assert_allclose(net.apply(variables, x), expected, atol=1e-5)


def test_kernels_start_orthogonal_and_biases_zero():
    scale = 0.01
    layers = _init(MLP((8, 5), 3, output_scale=scale))["params"]
    wide, tall = layers["hidden_0"]["kernel"], layers[OUTPUT_LAYER]["kernel"]
    np.testing.assert_allclose(wide @ wide.T, 2.0 * np.eye(INPUTS), atol=1e-5)
    np.testing.assert_allclose(tall.T @ tall, scale**2 * np.eye(3), atol=1e-8)
    for layer in layers.values():
        np.testing.assert_array_equal(layer["bias"], 0.0)


def test_every_configurable_activation_exists():
    for name in ACTIVATIONS:
        NetworkConfig(activation=name)
    assert float(ACTIVATIONS["relu6"](jnp.asarray(9.0))) == 6.0
    assert float(ACTIVATIONS["relu"](jnp.asarray(9.0))) == 9.0
