"""Starts at the frontier of what the policy can do are drawn more often than the others.

Success is followed in cells: place x style x part of the curve at which it starts, where a place is
a kind of start in a region (the kind alone on a flat plane). Lying starts are all in the first
part. At the frontier a start sometimes succeeds, or
it fails and the next part of the curve is solved (reverse curriculum, Florensa et al. 2017). A
solved episode is several times as long as one that fails, so that with even draws most samples
would come from what is learned already.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from getup_jax.envs.getup.episode import CLIP
from getup_jax.envs.getup.resets.pool import Pool

BINS = 24  # parts of a curve: the passage that is missing is often a quarter of a second long
RATE = 0.1  # share of an episode's result in its cell's running mean


def first(pool: Pool) -> jax.Array:
    """Success rate [3 R, G, BINS] before any episode: none."""
    kinds, regions, styles, _ = pool.table.shape
    return jnp.zeros((kinds * regions, styles, BINS), jnp.float32)


def place_of(pool: Pool, kind: jax.Array, region: jax.Array | None) -> jax.Array:
    """Place [B] int32 of starts of the kinds [B] in the regions [B]; None: there is one region."""
    return kind if region is None else kind * pool.table.shape[1] + region


def bin_of(begin: jax.Array) -> jax.Array:
    """Part of the curve [...] int32 of starts at begin [...], in shares of its duration."""
    return jnp.clip(jnp.floor(begin * BINS + 1e-3), 0, BINS - 1).astype(jnp.int32)


def weights(
    learned: jax.Array,
    pool: Pool,
    duration: jax.Array,
    strength: float,
    even: bool = False,
    everywhere: bool = False,
) -> jax.Array:
    """Weight [3 R, G, M] of every entry of the pool's table: 1 - strength + strength * frontier.

    Zero for the styles that cannot start in a region. With `even`, a style's weights are scaled to
    the sum of their largest one: else a style of which much succeeds at times is drawn ten times
    as often as one of which nothing does but the end. everywhere: all regions have starts along the
    curve.
    """
    table = pool.table.reshape(-1, *pool.table.shape[2:])
    part = bin_of(pool.time[table] / duration[:, None])
    places, styles, _ = part.shape
    cell = (jnp.arange(places)[:, None, None], jnp.arange(styles)[None, :, None], part)
    used = jnp.zeros(learned.shape, bool).at[cell].set(True)
    near = frontier(learned, used, pool.table.shape[1], everywhere)
    weight = 1.0 - strength + strength * jnp.take_along_axis(near, part, axis=-1)
    if even:
        scale = jnp.max(weight, axis=-1) / jnp.sum(weight, axis=-1)
        weight = weight * scale[..., None]
    if pool.startable is None:
        return weight
    order, count = pool.startable.styles, pool.startable.count
    startable = jnp.argsort(order, axis=-1) < count[:, None]  # [R, G]
    return weight * jnp.tile(startable, (pool.table.shape[0], 1))[..., None]


def frontier(
    learned: jax.Array, used: jax.Array, regions: int = 1, everywhere: bool = False
) -> jax.Array:
    """How near [3 R, G, BINS] (0 to 1) every cell is to the frontier; used: it has starts.

    The larger of 4 p (1 - p) and q - p, where p is the cell's success and q the larger one of the
    next two parts of the curve that have starts: from some starts nothing leads on, and those
    before them must not wait. After the last part comes success itself, and after a lying start
    what starts along the curve: in its region if they are everywhere, else in the first one.
    """
    first, count = CLIP * regions, regions if everywhere else 1
    shown, has = learned[first : first + count], used[first : first + count]  # [R or 1, G, BINS]
    following = after_that = jnp.ones(shown.shape[:2])
    near = []
    for part in reversed(range(BINS)):
        near.append(jnp.maximum(following, after_that))
        after_that = jnp.where(has[..., part], following, after_that)
        following = jnp.where(has[..., part], shown[..., part], following)
    along = jnp.stack(near[::-1], axis=-1)
    lying = jnp.broadcast_to(jnp.maximum(following, after_that)[..., None], along.shape)
    ahead = jnp.stack([lying, jnp.ones_like(along), along])  # [3, R or 1, G, BINS]
    ahead = jnp.broadcast_to(ahead, (3, regions, *along.shape[1:])).reshape(learned.shape)
    return jnp.maximum(4.0 * learned * (1.0 - learned), ahead - learned)


def draw(weight: jax.Array, place: jax.Array, key: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Styles [B] and rows [B] int32 of starts at the given places [B], in proportion to weight."""
    places, _, rows = weight.shape
    total = jnp.cumsum(weight.reshape(places, -1), axis=-1)
    share = jax.random.uniform(key, place.shape)
    entry = jnp.stack([jnp.searchsorted(t, share * t[-1], side="right") for t in total])
    chosen = jnp.minimum(entry[place, jnp.arange(len(place))], total.shape[-1] - 1)
    return (chosen // rows).astype(jnp.int32), (chosen % rows).astype(jnp.int32)
