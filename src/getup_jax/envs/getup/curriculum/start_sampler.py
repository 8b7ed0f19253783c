"""What new episodes start from while training: kind, style, row of the pool, length, curve."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import jax
import jax.numpy as jnp

from getup_jax.config import CurriculumConfig
from getup_jax.envs.getup.curriculum import regions, start_prioritisation
from getup_jax.envs.getup.curriculum.state import CurriculumState
from getup_jax.envs.getup.drawn_curves import Curve, Library, draw_curves
from getup_jax.envs.getup.episode import CLIP, LYING, STANDING
from getup_jax.envs.getup.resets.pool import Pool

_CURVES = 99  # folded into a key that is also split: none of its parts, which are 0, 1, 2, ...


class Draw(NamedTuple):
    """What B episodes start from."""

    getup: jax.Array  # [B] int32
    kind: jax.Array  # [B] int32
    row: jax.Array  # [B] int32, of the pool
    region: jax.Array | None = None  # [B] int32; None on a flat plane
    lasts: jax.Array | None = None  # [B] s at most, inf: to the end; None: all of them are
    assisted: jax.Array | None = None  # [B] bool, with the assistive wrench; None: there is none
    curve: Curve | None = None  # None: those of the styles


class StartWorld(Library, Protocol):
    """The part of the task's world that draws need."""

    @property
    def pool(self) -> Pool:
        """The start states."""
        ...


def draw_starts(
    config: CurriculumConfig,
    stand_start: float,
    world: StartWorld,
    key: jax.Array,
    num_envs: int,
    state: CurriculumState,
) -> Draw:
    """Starts of B = num_envs episodes, even draws where the state has no success rates.

    Starts with the assistive wrench are drawn where it is about to let go. The curves are those of
    the styles, see `with_curves`.
    """
    learned, levels = state.success, state.wrench
    key_place, key_style, key_row, key_short, key_help = jax.random.split(key, 5)
    kind, region = _places(config, stand_start, key_place, num_envs, state.regions)
    lasts = None
    if config.short_share > 0:
        chance = jax.random.uniform(key_short, (num_envs,))
        short = (chance < config.short_share) & (kind != STANDING)
        lasts = jnp.where(short, config.short_s, jnp.inf)
    assisted = None
    if config.assistive_wrench > 0:
        chance = jax.random.uniform(key_help, (num_envs,))
        assisted = (chance < config.assisted_share) & (kind != STANDING)
    if learned is not None:
        place = start_prioritisation.place_of(world.pool, kind, region)

        def frontier(learned: jax.Array) -> tuple[jax.Array, jax.Array]:
            weight = start_prioritisation.weights(
                learned,
                world.pool,
                world.duration,
                config.prioritisation,
                config.even_styles,
                config.reference_everywhere,
            )
            return start_prioritisation.draw(weight, place, key_row)

        getup, row = frontier(learned)
        if assisted is not None and levels is not None:
            with_wrench = frontier(1.0 - levels)
            getup = jnp.where(assisted, with_wrench[0], getup)
            row = jnp.where(assisted, with_wrench[1], row)
        return Draw(getup, kind, row, region, lasts, assisted)
    *_, num_styles, rows = world.pool.table.shape
    startable = world.pool.startable
    if region is None or startable is None:
        getup = jax.random.randint(key_style, (num_envs,), 0, num_styles)
    else:
        place = jax.random.randint(key_style, (num_envs,), 0, startable.count[region])
        getup = startable.styles[region, place]
    row = jax.random.randint(key_row, (num_envs,), 0, rows)
    return Draw(getup, kind, row, region, lasts)


def with_curves(
    config: CurriculumConfig,
    match_rad: float,
    world: Library,
    key: jax.Array,
    drawn: Draw,
    first: jax.Array | int = 0,
) -> Draw:
    """The starts with the share of drawn curves that is asked for.

    key is that of the starts, and `first` the number of their first one in the batch: so the
    starts do not depend on the setting, and curves cost only as many rows as begin.
    """
    if config.drawn_curves == 0:
        return drawn
    key_curve = jax.random.fold_in(jax.random.fold_in(key, _CURVES), first)
    curve = draw_curves(config, match_rad, world, key_curve, drawn.getup, drawn.kind)
    return drawn._replace(curve=curve)


def _places(
    config: CurriculumConfig,
    stand: float,
    key: jax.Array,
    num_envs: int,
    progress: regions.RegionProgress | None,
) -> tuple[jax.Array, jax.Array | None]:
    """Kinds of start [B] and regions [B], None on a flat plane."""
    key_kind, key_region = jax.random.split(key)
    draw = jax.random.uniform(key_kind, (num_envs,))
    clip = config.reference_start
    kind = jnp.where(draw < stand, STANDING, jnp.where(draw < stand + clip, CLIP, LYING))
    kind = kind.astype(jnp.int32)
    if progress is None:
        return kind, None
    region = regions.draw_region(progress, key_region, num_envs, config.prioritisation)
    if not config.reference_everywhere:
        kind = jnp.where((region > 0) & (kind == CLIP), LYING, kind)
    return kind, region
