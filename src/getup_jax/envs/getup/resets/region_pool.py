"""The pool of start states on irregular ground, with one part for every region."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import jax.numpy as jnp
import numpy as np

from getup_jax.config import ConfigError, TaskConfig, TerrainConfig
from getup_jax.core.resources import cache_dir
from getup_jax.core.types import Engine
from getup_jax.envs.getup.episode import CLIP, LYING, STANDING
from getup_jax.envs.getup.resets.cache import Request, cached_starts
from getup_jax.envs.getup.resets.lying import Starts
from getup_jax.envs.getup.resets.lying_bodies import LimpBodies
from getup_jax.envs.getup.resets.pool import (
    FlatStarts,
    FreeStarts,
    Pool,
    Startable,
    check_finite,
    given_actions,
    kind_shares,
)
from getup_jax.envs.getup.resets.standing import stand
from getup_jax.envs.getup.resets.style_matching import fits, least_used
from getup_jax.envs.getup.resets.terrain_projection import project_to_ground
from getup_jax.motion.clips import GetUp
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.terrain_map import REGIONS, TerrainMap

Log = Callable[[str], None]


@dataclasses.dataclass(frozen=True, eq=False)
class Site:
    """Irregular ground, its config, and the character on it."""

    config: TerrainConfig
    ground: TerrainMap
    character: CharacterSpec  # with the ground in its model


def build_region_pool(
    getups: Sequence[GetUp],
    flat: FlatStarts,
    site: Site,
    engine: Engine,
    config: TaskConfig,
    log: Log,
) -> Pool:
    """The start states of all regions.

    The flat region has those of the flat plane at random places. In the others a style starts
    from rag-dolls that fell so that their torso angles fit it, or standing, and along its clip if
    `curriculum.reference_everywhere`; one that no rag-doll fits is left out of the region.
    """
    irregular = _irregular_starts(site, config, log)
    fair = fits(getups, irregular[LYING].qpos, site.character, config.curve_match_rad)
    rows, rng = _rows(flat, len(getups)), np.random.default_rng(flat.seed)
    table = np.zeros((3, len(REGIONS), len(getups), rows), np.int32)
    parts = [_on_the_flat(flat, site, table, rng, log)]
    startable = np.ones((len(REGIONS), len(getups)), bool)
    for region in range(1, len(REGIONS)):
        own = {kind: starts.region == region for kind, starts in irregular.items()}
        startable[region] = fair[own[LYING]].any(axis=0)
        _check_region(startable[region], region, getups, config, log)
        for kind in (LYING, STANDING):
            used = np.zeros(len(own[kind]), int)
            for style, getup in enumerate(getups):
                chosen = own[kind] & fair[:, style] if kind == LYING else own[kind]
                # a style that cannot start here is never drawn, but its rows must hold something
                index = least_used(chosen if chosen.any() else own[kind], used, rows, rng)
                time = np.full(rows, getup.duration if kind == STANDING else 0.0)
                table[kind, region, style] = sum(len(p) for p in parts) + np.arange(rows)
                none = np.full((rows, flat.action_size), np.nan)
                starts = irregular[kind].take(index)
                parts.append(FreeStarts(starts.qpos, starts.qvel, time, none))
        if flat.curriculum.reference_everywhere:
            size = sum(len(p) for p in parts)
            table[CLIP, region] = size + np.arange(len(getups) * rows).reshape(-1, rows)
            parts.append(_along(parts[0], table[CLIP, 0].ravel(), region, site, rng))
        else:
            table[CLIP, region] = table[LYING, region]
    order = np.argsort(~startable, axis=1, kind="stable").astype(np.int32)
    count = startable.sum(axis=1).astype(np.int32)
    return _pool(parts, table, Startable(jnp.asarray(order), jnp.asarray(count)), site, engine)


def _along(
    flat: FreeStarts, index: np.ndarray, region: int, site: Site, rng: np.random.Generator
) -> FreeStarts:
    """The flat region's starts of the given rows, set down at random places of another region."""
    qpos, qvel = project_to_ground(
        site.character,
        site.ground.field(),
        flat.qpos[index],
        flat.qvel[index],
        site.ground.draw_spawn(region, len(index), rng),
        rng.uniform(-np.pi, np.pi, len(index)),
    )
    return FreeStarts(qpos, qvel, flat.time[index], flat.action[index])


def _pool(
    parts: list[FreeStarts], table: np.ndarray, startable: Startable, site: Site, engine: Engine
) -> Pool:
    starts = FreeStarts.join(parts)
    site.ground.check_spawn(starts.qpos[:, :2])
    physics = engine.place(starts.qpos, starts.qvel)
    check_finite(physics, starts.qpos)
    return Pool(
        physics=physics,
        time=jnp.asarray(starts.time, jnp.float32),
        table=jnp.asarray(table),
        action=given_actions(starts),
        startable=startable,
    )


def region_starts(pool: Pool, episodes: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Styles, rows and regions [N] int32 of episodes that visit all regions and styles in turn.

    In a region come the styles that can start there, each with one row after the other. The same
    pool gives the same places.
    """
    if pool.startable is None:
        raise ValueError("region_starts: expected a pool of irregular ground")
    order, count = np.asarray(pool.startable.styles), np.asarray(pool.startable.count)
    number = np.arange(episodes)
    region, visit = number % len(count), number // len(count)
    style = order[region, visit % count[region]]
    row = visit // count[region] % pool.table.shape[-1]
    return style.astype(np.int32), row.astype(np.int32), region.astype(np.int32)


def _rows(flat: FlatStarts, styles: int) -> int:
    """M, the rows of every kind, region and style."""
    kinds = sum(share > 0 for share in kind_shares(flat.config, flat.curriculum))
    return -(-flat.config.pool_size // (styles * kinds * len(REGIONS)))


def _irregular_starts(site: Site, config: TaskConfig, log: Log) -> dict[int, Starts]:
    """Lying and standing starts of the irregular regions, from the cache or made now."""
    place, seed = cache_dir() / "starts", site.config.seed
    standing = Request("standing", max(30, site.config.drops // 5), seed)

    def rise(request: Request, log: Log) -> Starts:
        return stand(site.character, site.ground, request.count, request.seed, log)

    bodies = LimpBodies(site.character, site.ground, config, seed, log)
    stands = cached_starts(standing, site.character, rise, place, log)
    return {LYING: bodies.on_slopes(site.config.drops, stands), STANDING: stands}


def _on_the_flat(
    flat: FlatStarts, site: Site, table: np.ndarray, rng: np.random.Generator, log: Log
) -> FreeStarts:
    """The flat region's starts, the first in the pool; their rows are written into the table."""
    starts, table[:, 0] = flat.make(table.shape[-1])
    starts.qpos[:, :2] = site.ground.draw_spawn(0, len(starts), rng)  # recordings are far from 0
    flat.lay_down(starts, table[LYING, 0], site.character, log)
    return starts


def _check_region(
    startable: np.ndarray, region: int, getups: Sequence[GetUp], config: TaskConfig, log: Log
) -> None:
    """Say which styles cannot start in a region; an error if none can."""
    missing = [getup.name for getup, ok in zip(getups, startable, strict=True) if not ok]
    if len(missing) == len(getups):
        raise ConfigError(
            f"terrain: no rag-doll in the region {REGIONS[region]!r} lies within "
            f"task.curve_match_rad = {config.curve_match_rad} of the start of any get-up; raise "
            "it, or terrain.drops"
        )
    if missing:
        log(f"start states: nothing in the region {REGIONS[region]!r} fits {', '.join(missing)}")
