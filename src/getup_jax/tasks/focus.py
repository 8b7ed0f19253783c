"""Starts at the frontier of what the policy can do are drawn more often than the others.

Success is followed in cells: kind of start x style x part of the curve at which it starts. At the
frontier a start sometimes succeeds, or it fails and the next part of the curve is solved (reverse
curriculum, Florensa et al. 2017). A solved episode is several times as long as one that fails, so
that with even draws most samples would come from what needs no more practice.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from getup_jax.tasks.episode import CLIP
from getup_jax.tasks.reset_pool import Pool

BINS = 8  # parts of a curve
RATE = 0.1  # share of an episode's result in its cell's running mean


def first(pool: Pool) -> jax.Array:
    """Running success [3, G, BINS] before any episode: none."""
    kinds, styles, _ = pool.table.shape
    return jnp.zeros((kinds, styles, BINS), jnp.float32)


def bin_of(begin: jax.Array) -> jax.Array:
    """Part of the curve [...] int32 of starts at begin [...], in shares of its duration."""
    return jnp.clip(jnp.floor(begin * BINS + 1e-3), 0, BINS - 1).astype(jnp.int32)


def weights(learned: jax.Array, pool: Pool, duration: jax.Array, focus: float) -> jax.Array:
    """Weight [3, G, M] of every entry of the pool's table: 1 - focus + focus * frontier."""
    part = bin_of(pool.time[pool.table] / duration[:, None])
    kinds, styles, _ = part.shape
    place = (jnp.arange(kinds)[:, None, None], jnp.arange(styles)[None, :, None], part)
    used = jnp.zeros(learned.shape, bool).at[place].set(True)
    return 1.0 - focus + focus * jnp.take_along_axis(frontier(learned, used), part, axis=-1)


def frontier(learned: jax.Array, used: jax.Array) -> jax.Array:
    """How near [3, G, BINS] (0 to 1) every cell is to the frontier; used: the pool has its starts.

    The larger of 4 p (1 - p) and q - p, where p is the cell's success and q that of the next part
    of the curve that has starts. After the last part comes success itself, and after a lying start
    what starts along the curve.
    """
    following, near = jnp.ones(learned.shape[1:2]), []
    for part in reversed(range(BINS)):  # of the starts along the curve
        near.append(following)
        following = jnp.where(used[CLIP, :, part], learned[CLIP, :, part], following)
    along = jnp.stack(near[::-1], axis=-1)
    ahead = jnp.stack(
        [jnp.broadcast_to(following[:, None], along.shape), jnp.ones_like(along), along]
    )
    return jnp.maximum(4.0 * learned * (1.0 - learned), ahead - learned)


def draw(weight: jax.Array, kind: jax.Array, key: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Styles [B] and rows [B] int32 of starts of the given kinds [B], in proportion to weight."""
    kinds, _, rows = weight.shape
    total = jnp.cumsum(weight.reshape(kinds, -1), axis=-1)
    share = jax.random.uniform(key, kind.shape)
    entry = jnp.stack([jnp.searchsorted(t, share * t[-1], side="right") for t in total])
    chosen = jnp.minimum(entry[kind, jnp.arange(len(kind))], total.shape[-1] - 1)
    return (chosen // rows).astype(jnp.int32), (chosen % rows).astype(jnp.int32)


def update(
    learned: jax.Array, cell: tuple[jax.Array, ...], ended: jax.Array, success: jax.Array
) -> jax.Array:
    """The running success with the episodes [B] that ended; cell holds their indices [B]."""
    number = jnp.zeros_like(learned).at[cell].add(ended.astype(jnp.float32))
    good = jnp.zeros_like(learned).at[cell].add((ended & success).astype(jnp.float32))
    share = 1.0 - (1.0 - RATE) ** number
    return learned + share * (good / jnp.maximum(number, 1.0) - learned)
