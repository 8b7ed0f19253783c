from __future__ import annotations

import jax
import numpy as np
from numpy.testing import assert_allclose

from getup_jax.networks.recurrent import GRU, HistoryMLP

FRAMES = np.random.default_rng(0).normal(size=(5, 4, 3)).astype(np.float32)


def _sigmoid(x):
    return 1.0 / (1.0 + np.exp(-x))


def test_gru_matches_a_slow_loop():
    model = GRU(6)
    variables = jax.jit(model.init)(jax.random.key(0), FRAMES)
    params = jax.tree.map(lambda x: np.asarray(x, np.float64), variables["params"])
    rng = np.random.default_rng(1)
    # biases start at zero, which would hide a bias in the wrong place
    for part in params.values():
        part["bias"] = rng.normal(size=18)
    hidden = np.zeros((5, 6))
    for frame in range(4):
        x = FRAMES[:, frame] @ params["input"]["kernel"] + params["input"]["bias"]
        h = hidden @ params["recurrent"]["kernel"] + params["recurrent"]["bias"]
        reset, update = _sigmoid(x[:, :6] + h[:, :6]), _sigmoid(x[:, 6:12] + h[:, 6:12])
        new = np.tanh(x[:, 12:] + reset * h[:, 12:])
        hidden = (1 - update) * new + update * hidden
    found = jax.jit(model.apply)({"params": params}, FRAMES)
    assert_allclose(found, hidden, atol=1e-5)


def test_history_is_split_from_the_goal_and_read_in_order():
    model = HistoryMLP(4, 3, 6, (8,), 2)
    x = np.concatenate([FRAMES.reshape(5, 12), np.ones((5, 2), np.float32)], axis=1)
    variables = jax.jit(model.init)(jax.random.key(0), x)
    apply = jax.jit(model.apply)
    params = jax.tree.map(np.asarray, variables["params"])
    state = np.asarray(jax.jit(GRU(6).apply)({"params": params["gru"]}, FRAMES))
    joined = np.concatenate([state, x[:, 12:]], 1)
    first, last = params["hidden_0"], params["output"]
    hidden = np.maximum(joined @ first["kernel"] + first["bias"], 0.0)
    out = apply(variables, x)
    assert_allclose(out, hidden @ last["kernel"] + last["bias"], atol=1e-5)
    # leading axes are free
    assert_allclose(apply(variables, x[None, None])[0, 0], out, atol=1e-6)
