from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.core.types import array_module
from getup_jax.motion.getup import curves

LINKS = curves.FeatureLinks(root=0, neck=1, left_hip=2, right_hip=3)


def test_numpy_stays_numpy_and_what_is_traced_is_jax():
    assert array_module(np.ones(2), 3.0) is np
    assert array_module(np.ones(2), jnp.ones(2)) is jnp
    seen = []
    jax.jit(lambda x: seen.append(array_module(x)) or x)(np.ones(2))
    assert seen == [jnp]


@pytest.mark.parametrize(
    "formula",
    [
        lambda x: curves.basis(x[..., 0, 0]),
        lambda x: curves.evaluate(np.linspace(0.1, 1.5, 27).reshape(9, 3), x[0, :, 0]),
        lambda x: curves.features(LINKS, x, 0.25),
    ],
)
def test_both_give_the_same_numbers(formula):
    x = np.random.default_rng(0).normal(size=(6, 4, 3)).astype(np.float32)
    on_host = formula(x)
    assert isinstance(on_host, np.ndarray)
    np.testing.assert_allclose(on_host, jax.jit(formula)(x), rtol=1e-5, atol=2e-6)
