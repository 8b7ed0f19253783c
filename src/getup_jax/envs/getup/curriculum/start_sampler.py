"""What new episodes start from while training: kind, style, row of the pool, length, curve."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple, Protocol

import jax
import jax.numpy as jnp

from getup_jax.config import TaskConfig
from getup_jax.envs.getup.curriculum import regions, start_prioritisation
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
    helped: jax.Array | None = None  # [B] bool, with the helping hand; None: there is none
    curve: Curve | None = None  # None: those of the styles


def whole_episodes(config: TaskConfig) -> TaskConfig:
    """The settings without what only helps to train: starts on the way, focus, hand and so on."""
    return dataclasses.replace(
        config,
        clip_start=0.0,
        paths=None,
        focus=0.0,
        short_share=0.0,
        assist=0.0,
        head_grace_s=0.0,
        limp_share=0.0,
        drop_as="limp",
        fallen_share=0.0,
        drawn_share=0.0,
        sharpness=1.0,
        track_weight=0.0,
    )


class Starts(Library, Protocol):
    """The part of the task's world that draws need."""

    @property
    def pool(self) -> Pool:
        """The start states."""
        ...


def draw_starts(
    config: TaskConfig,
    world: Starts,
    key: jax.Array,
    num_envs: int,
    learned: jax.Array | None,
    progress: regions.Curriculum | None,
    levels: jax.Array | None = None,
) -> Draw:
    """Starts of B = num_envs episodes; learned: see start_prioritisation.py, None: even draws.

    levels are those of `assist.py`: starts with the hand are drawn where it is about to let go.
    Their curves are those of the styles, see `with_curves`.
    """
    key_place, key_style, key_row, key_short, key_help = jax.random.split(key, 5)
    kind, region = _places(config, key_place, num_envs, progress)
    lasts = None
    if config.short_share > 0:
        chance = jax.random.uniform(key_short, (num_envs,))
        short = (chance < config.short_share) & (kind != STANDING)
        lasts = jnp.where(short, config.short_s, jnp.inf)
    helped = None
    if config.assist > 0:
        chance = jax.random.uniform(key_help, (num_envs,))
        helped = (chance < config.assist_share) & (kind != STANDING)
    if learned is not None:
        place = start_prioritisation.place_of(world.pool, kind, region)

        def frontier(learned: jax.Array) -> tuple[jax.Array, jax.Array]:
            weight = start_prioritisation.weights(
                learned,
                world.pool,
                world.duration,
                config.focus,
                config.focus_even,
                config.clip_everywhere,
            )
            return start_prioritisation.draw(weight, place, key_row)

        getup, row = frontier(learned)
        if helped is not None and levels is not None:
            of_the_hand = frontier(1.0 - levels)
            getup = jnp.where(helped, of_the_hand[0], getup)
            row = jnp.where(helped, of_the_hand[1], row)
        return Draw(getup, kind, row, region, lasts, helped)
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
    config: TaskConfig, world: Library, key: jax.Array, drawn: Draw, first: jax.Array | int = 0
) -> Draw:
    """The starts with the share of drawn curves that is asked for.

    key is that of the starts, and `first` the number of their first one in the batch: so the
    starts do not depend on the setting, and curves cost only as many rows as begin.
    """
    if config.drawn_share == 0:
        return drawn
    key_curve = jax.random.fold_in(jax.random.fold_in(key, _CURVES), first)
    return drawn._replace(curve=draw_curves(config, world, key_curve, drawn.getup, drawn.kind))


def _places(
    config: TaskConfig,
    key: jax.Array,
    num_envs: int,
    progress: regions.Curriculum | None,
) -> tuple[jax.Array, jax.Array | None]:
    """Kinds of start [B] and regions [B], None on a flat plane."""
    key_kind, key_region = jax.random.split(key)
    draw = jax.random.uniform(key_kind, (num_envs,))
    stand, clip = config.stand_start, config.clip_start
    kind = jnp.where(draw < stand, STANDING, jnp.where(draw < stand + clip, CLIP, LYING))
    kind = kind.astype(jnp.int32)
    if progress is None:
        return kind, None
    region = regions.draw_region(progress, key_region, num_envs, config.focus)
    if not config.clip_everywhere:
        kind = jnp.where((region > 0) & (kind == CLIP), LYING, kind)
    return kind, region
