"""The order in which the regions of irregular ground open during training [P 5.4].

All of it happens inside the compiled step. The counters are part of the environment's state, so
that a checkpoint keeps them and a resumed run goes on where it was.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.config import TerrainConfig
from getup_jax.core import device_axis
from getup_jax.core.masked_update import running_mean
from getup_jax.physics.terrain_map import REGIONS

_RATE = 0.01  # share of an episode's result in its region's success rate


@struct.dataclass
class RegionProgress:
    """Which regions are open, and how training goes in them."""

    opened: jax.Array  # [] int32 regions that are open, the first ones of REGIONS
    successes: jax.Array  # [] int32 in the newest of them, since it opened
    steps: jax.Array  # [] int32 steps of the whole batch
    rate: jax.Array  # [R] success rate of the episodes that began lying in each region


def first(config: TerrainConfig) -> RegionProgress:
    """Before training: the flat region is open, or all where there is no curriculum."""
    opened = len(REGIONS) if config.curriculum == "none" else 1
    zero = jnp.zeros((), jnp.int32)
    rate = jnp.zeros(len(REGIONS), jnp.float32)
    return RegionProgress(jnp.asarray(opened, jnp.int32), successes=zero, steps=zero, rate=rate)


def advance(
    state: RegionProgress,
    config: TerrainConfig,
    ended: jax.Array,
    success: jax.Array,
    region: jax.Array,
) -> RegionProgress:
    """After one step of B simulations.

    ended [B]: an episode that began lying in region [B] (int32) ended in this step; success [B]:
    and it ended standing.
    `success`: the next region opens after so many of them in the newest one; then they are counted
    anew [T 2.8]. `schedule`: it opens after a number of control steps.
    """
    steps = state.steps + 1
    newest = success & (region == state.opened - 1)
    successes = state.successes + device_axis.summed(jnp.sum(newest, dtype=jnp.int32))
    if config.curriculum == "success":
        opens = (successes >= config.unlock_successes) & (state.opened < len(REGIONS))
        opened = state.opened + opens.astype(jnp.int32)
    elif config.curriculum == "schedule":
        each = -(-config.schedule_steps // (len(region) * device_axis.size()))  # steps of the batch
        opened = jnp.minimum(1 + steps // each, len(REGIONS)).astype(jnp.int32)
    else:
        opened = state.opened
    successes = jnp.where(opened > state.opened, 0, successes)
    rate = running_mean(state.rate, (region,), ended, success, _RATE)
    return RegionProgress(opened=opened, successes=successes, steps=steps, rate=rate)


def draw_region(state: RegionProgress, key: jax.Array, count: int, share: float) -> jax.Array:
    """Regions [count] int32 of new episodes: the open ones, in proportion to 1 - share * success.

    With a share of 0 all as often. A solved episode is several times as long as one that fails, so
    that most samples then come from where least is to learn.
    """
    weight = 1.0 - share * state.rate
    weight = jnp.where(jnp.arange(len(REGIONS)) < state.opened, weight, 0.0)
    return jax.random.categorical(key, jnp.log(weight), shape=(count,)).astype(jnp.int32)


def by_region(episode: dict[str, jax.Array], region: jax.Array) -> dict[str, jax.Array]:
    """Success and return rate of lying starts, one metric a region, NaN in the other regions."""
    return {
        f"{name}_{title}": jnp.where(region == index, episode[name], jnp.nan)
        for name in ("success", "return_rate_lying")
        for index, title in enumerate(REGIONS)
    }
