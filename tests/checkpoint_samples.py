"""Trees of every kind of leaf, for the tests of storage and checkpoints."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct


@struct.dataclass
class Policy:
    actor: Any
    statistics: Any = None


class Moments(NamedTuple):
    mean: jax.Array
    total: jax.Array


@struct.dataclass
class State:
    policy: Policy
    optimiser: Any
    rows: jax.Array
    key: jax.Array
    typed_key: jax.Array
    iteration: jax.Array
    flags: jax.Array
    empty: jax.Array
    nothing: Any = None


def make_policy(seed: int, width: int = 8) -> Policy:
    kernel = jax.random.normal(jax.random.PRNGKey(seed), (5, width))
    statistics = Moments(jnp.arange(5.0) + seed, jnp.float32(seed))
    return Policy({"params": {"Dense_0": {"kernel": kernel}}}, statistics)


def make_state(seed: int, width: int = 8) -> State:
    policy = make_policy(seed, width)
    bits = jax.random.bits(jax.random.PRNGKey(seed), (3, 7), jnp.uint32)
    return State(
        policy=policy,
        optimiser=[(Moments(policy.actor, jnp.int32(seed)), ()), None],
        rows=bits.at[0, :2].set(jnp.array([0x7FC00001, 0xFFFFFFFF], jnp.uint32)),
        key=jax.random.PRNGKey(seed),
        typed_key=jax.random.key(seed),
        iteration=jnp.int32(seed),
        flags=jnp.array([True, False]),
        empty=jnp.zeros((0, 3), jnp.int8),
    )


def assert_same(a: Any, b: Any) -> None:
    """Structure, types, dtypes and bits."""
    assert jax.tree.structure(a) == jax.tree.structure(b)
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        assert isinstance(x, jax.Array) == isinstance(y, jax.Array)
        assert x.dtype == y.dtype
        if jnp.issubdtype(x.dtype, jax.dtypes.prng_key):
            x, y = jax.random.key_data(x), jax.random.key_data(y)
        assert np.asarray(x).tobytes() == np.asarray(y).tobytes()
        assert x.shape == y.shape
