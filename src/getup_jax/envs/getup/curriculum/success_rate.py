"""Success rates of what episodes are counted by: cells of start prioritisation, and regions."""

from __future__ import annotations

import jax
import jax.numpy as jnp


def update(
    mean: jax.Array,
    index: tuple[jax.Array, ...],
    ended: jax.Array,
    success: jax.Array,
    rate: float,
) -> jax.Array:
    """The running success [...] with the episodes [B] that ended.

    index: of the entries [B] that they count in; rate: share of a result in its entry's mean.
    """
    number = jnp.zeros_like(mean).at[index].add(ended.astype(jnp.float32))
    good = jnp.zeros_like(mean).at[index].add((ended & success).astype(jnp.float32))
    share = 1.0 - (1.0 - rate) ** number
    return mean + share * (good / jnp.maximum(number, 1.0) - mean)
