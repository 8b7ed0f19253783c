"""Reductions over all simulations, where a mesh of devices has a part of them each.

Code that reduces over the simulations calls these instead of `jnp` alone. Inside of a
`jax.shard_map` over the axis AXIS they reduce over its devices, too, so that every device has the
same result; elsewhere they are the plain functions, to the last bit.
"""

from __future__ import annotations

from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree

AXIS = "simulations"

T = TypeVar("T")


def size() -> int:
    """Devices that the simulations are spread over, at trace time."""
    try:
        return jax.lax.axis_size(AXIS)
    except NameError:  # the axis is not bound: no mesh
        return 1


def part(number: int) -> int:
    """A device's part of a number of all devices; the caller has seen that it divides."""
    return number // size()


def own_key(key: jax.Array) -> jax.Array:
    """A key of this device's own, of one that is the same on all; on one device the key itself."""
    return key if size() == 1 else jax.random.fold_in(key, jax.lax.axis_index(AXIS))


def averaged(tree: T) -> T:
    """The mean over devices of a pytree of float arrays, in one message."""
    if size() == 1:
        return tree
    flat, restore = ravel_pytree(tree)
    return restore(jax.lax.pmean(flat, AXIS))


def summed(x: jax.Array) -> jax.Array:
    """The sum over devices of an array."""
    return x if size() == 1 else jax.lax.psum(x, AXIS)


def mean(x: jax.Array, axes: tuple[int, ...] | None = None) -> jax.Array:
    """`jnp.mean` of x, of which every device has as many elements."""
    return averaged(jnp.mean(x, axes))


def var(x: jax.Array, axes: tuple[int, ...] | None = None) -> jax.Array:
    """`jnp.var` of x, of which every device has as many elements."""
    if size() == 1:
        return jnp.var(x, axes)
    centre = averaged(jnp.mean(x, axes, keepdims=True))
    return mean(jnp.square(x - centre), axes)


def std(x: jax.Array, axes: tuple[int, ...] | None = None) -> jax.Array:
    """`jnp.std` of x, of which every device has as many elements."""
    return jnp.std(x, axes) if size() == 1 else jnp.sqrt(var(x, axes))


def added(x: jax.Array, index: tuple[jax.Array | slice, ...], change: jax.Array) -> jax.Array:
    """`x.at[index].add(change)` with the indices and changes of all devices; x is the same."""
    if size() == 1:
        return x.at[index].add(change)
    return x + summed(jnp.zeros_like(x).at[index].add(change))


def same_on_all(tree: Any) -> bool:
    """Whether arrays outside of jit that should be the same on all devices are, bit for bit."""

    def same(x: jax.Array) -> bool:
        shards = [jax.device_get(shard.data) for shard in x.addressable_shards]
        return all(shards[0].tobytes() == shard.tobytes() for shard in shards)

    return all(same(x) for x in jax.tree.leaves(tree))
