"""Work on the few rows of a batch that need it, instead of on all of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from getup_jax.core import device_axis


def replace_rows(
    rows: Any, mask: jax.Array, compute: Callable[[jax.Array], Any], chunk: int
) -> Any:
    """The pytree rows [N, ...] with `compute` in the rows where mask [N].

    `compute` gets row numbers [C] and gives new rows [C, ...]. It is called inside a loop that goes
    through the masked rows C = min(chunk, N) at a time, so that its cost is that of the rows that
    change. The last chunk is filled up with other rows, whose result is dropped.
    """
    total = mask.shape[0]
    size = min(chunk, total)
    place_in_order = jnp.cumsum(mask) - 1
    order = jnp.zeros(total + size, jnp.int32)  # the masked rows, then zeros
    order = order.at[jnp.where(mask, place_in_order, total + size)].set(
        jnp.arange(total, dtype=jnp.int32), mode="drop"
    )
    count = jnp.sum(mask)

    def replace_chunk(carry: tuple[jax.Array, Any]) -> tuple[jax.Array, Any]:
        first, rows = carry
        index = jax.lax.dynamic_slice_in_dim(order, first, size)
        masked = first + jnp.arange(size) < count
        place = jnp.where(masked, index, total)  # past the end: dropped
        rows = jax.tree.map(
            lambda old, new: old.at[place].set(new, mode="drop"), rows, compute(index)
        )
        return first + size, rows

    start = jnp.zeros((), count.dtype)
    return jax.lax.while_loop(lambda carry: carry[0] < count, replace_chunk, (start, rows))[1]


def running_mean(
    mean: jax.Array,
    index: tuple[jax.Array, ...],
    counts: jax.Array,
    good: jax.Array,
    rate: float,
) -> jax.Array:
    """The running means [...] of entries after some of B results came in: which ones, [B] bool.

    On many devices the results are those of all of them.

    index: of the entries [B] that they count in; good [B]: 1, else 0; rate: share of a result in
    its entry's mean.
    """
    both = jnp.stack([counts, counts & good]).astype(mean.dtype)  # one message for two tables
    none = jnp.zeros((2, *mean.shape), mean.dtype)
    number, total = device_axis.added(none, (slice(None), *index), both)
    share = 1.0 - (1.0 - rate) ** number
    return mean + share * (total / jnp.maximum(number, 1.0) - mean)
