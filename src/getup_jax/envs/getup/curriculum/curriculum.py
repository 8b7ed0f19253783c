"""What helps to train, as one object: it draws the starts, and learns from the episodes that end.

The environment knows states, rewards and ends; which starts come how often, which of them have the
assistive wrench or are cut short, and which regions are open, is decided here.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple, Protocol

import jax
import jax.numpy as jnp

from getup_jax.config import CurriculumConfig, TerrainConfig
from getup_jax.core import device_axis
from getup_jax.core.masked_update import running_mean
from getup_jax.core.types import Kinematics, StepOutput
from getup_jax.envs.getup.curriculum import (
    assistive_wrench,
    regions,
    start_prioritisation,
)
from getup_jax.envs.getup.curriculum.state import CurriculumState
from getup_jax.envs.getup.drawn_curves import Curve, Library, draw_curves
from getup_jax.envs.getup.episode import (
    CLIP,
    LYING,
    STANDING,
    EpisodeState,
    is_alone,
    runs_to_the_end,
    stands,
)
from getup_jax.envs.getup.observation import Observer
from getup_jax.envs.getup.resets.pool import Pool
from getup_jax.motion.getup.curves import FeatureLinks
from getup_jax.physics.terrain import Ground

_CHEST = 0.7  # of the way from the root to the neck's base
_PUSHES = 98  # folded into a key, as _CURVES is
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


@dataclasses.dataclass(frozen=True)
class Curriculum:
    """Draws starts, and follows how episodes from them end; pure functions of its state."""

    config: CurriculumConfig
    stand_start: float  # share of episodes that start standing
    control_dt: float  # s
    most_lift: float  # N, of the assistive wrench
    curve_match_rad: float  # largest gap between the first angles of curves that are blended
    terrain: TerrainConfig | None = None  # None: a flat plane

    def first(self, pool: Pool) -> CurriculumState:
        """Before any episode."""
        success = wrench = None
        if self.config.prioritisation > 0:
            success = start_prioritisation.first(pool)
            wrench = jnp.ones_like(success) if self.config.assistive_wrench > 0 else None
        opened = None if self.terrain is None else regions.first(self.terrain)
        return CurriculumState(success, wrench, opened)

    def draw(self, world: StartWorld, state: CurriculumState, key: jax.Array, size: int) -> Draw:
        """What B = size episodes start from: even draws where the state has no success rates.

        Starts with the assistive wrench are drawn where it is about to let go. The curves are those
        of the styles, see `with_curves`.
        """
        config = self.config
        key_place, key_style, key_row, key_short, key_help = jax.random.split(key, 5)
        kind, region = self._places(key_place, size, state.regions)
        lasts = assisted = None
        if config.short_share > 0:
            chance = jax.random.uniform(key_short, (size,))
            short = (chance < config.short_share) & (kind != STANDING)
            lasts = jnp.where(short, config.short_s, jnp.inf)
        if state.success is None:
            getup, row = _evenly(world.pool, region, key_style, key_row, size)
            return Draw(getup, kind, row, region, lasts)
        place = start_prioritisation.place_of(world.pool, kind, region)
        getup, row = self._at_frontier(world, state.success, place, key_row)
        if config.assistive_wrench > 0:
            chance = jax.random.uniform(key_help, (size,))
            assisted = (chance < config.assisted_share) & (kind != STANDING)
        if assisted is not None and state.wrench is not None:
            with_wrench = self._at_frontier(world, 1.0 - state.wrench, place, key_row)
            getup = jnp.where(assisted, with_wrench[0], getup)
            row = jnp.where(assisted, with_wrench[1], row)
        return Draw(getup, kind, row, region, lasts, assisted)

    def with_curves(
        self, world: Library, key: jax.Array, drawn: Draw, first: jax.Array | int = 0
    ) -> Draw:
        """The starts with the share of drawn curves that is asked for.

        key is that of the starts, and `first` the number of their first one in the batch: so the
        starts do not depend on the setting, and curves cost only as many rows as begin.
        """
        if self.config.drawn_curves == 0:
            return drawn
        key_curve = jax.random.fold_in(jax.random.fold_in(key, _CURVES), first)
        match_rad, style, kind = self.curve_match_rad, drawn.getup, drawn.kind
        curve = draw_curves(self.config, match_rad, world, key_curve, style, kind)
        return drawn._replace(curve=curve)

    def prepared(
        self, pool: Pool, state: CurriculumState, drawn: Draw, begun: EpisodeState
    ) -> EpisodeState:
        """Episodes that began as drawn, with when they are cut and the lift that they have."""
        if drawn.lasts is not None:
            begun = begun.replace(until=begun.time + drawn.lasts)
        if drawn.assisted is None or state.wrench is None:
            return begun
        most = self.most_lift * state.wrench[self.first_cell(pool, begun)]
        return begun.replace(lift=jnp.where(drawn.assisted, most, 0.0))

    def wrench(
        self, ground: Ground, observer: Observer, state: EpisodeState, targets: jax.Array
    ) -> jax.Array | None:
        """The assistive wrench and random pushes [B, 6] of a control step; None: there are none.

        targets: [B, n, 3] curve values, the first of now.
        """
        kinematics = state.physics.kinematics
        push = self.push(state.key, observer.links, kinematics)
        if state.lift is None:
            return push
        measured = state.observation[:, observer.slices()["features"]]
        normal = ground.normal(kinematics.qpos[:, :2])
        lift = assistive_wrench.wrench(
            observer.links, kinematics, measured, targets[:, 0], normal, state.lift
        )
        return lift if push is None else lift + push

    def push(
        self, key: jax.Array | None, links: FeatureLinks, kinematics: Kinematics
    ) -> jax.Array | None:
        """Random pushes for a control step: force (N) and torque (Nm) [B, 6] on the root, world.

        Each simulation is pushed with the chance that makes one every `push_interval_s`, towards
        any side, by an impulse p; f = p / dt acts at the chest, m = (chest - root) x f. None: there
        are none.
        """
        config = self.config
        if config.push_ns == 0 or key is None:
            return None
        root, neck = (kinematics.link_position[:, i] for i in (links.root, links.neck))
        key = device_axis.own_key(jax.random.fold_in(key, _PUSHES))
        chance, size, way = jax.random.uniform(key, (3, len(root)))
        size = jnp.where(chance < self.control_dt / config.push_interval_s, size, 0.0)
        way = 2.0 * jnp.pi * way
        level = jnp.stack([jnp.cos(way), jnp.sin(way), jnp.zeros_like(way)], axis=-1)
        force = (config.push_ns / self.control_dt * size)[:, None] * level
        return jnp.concatenate([force, jnp.cross(_CHEST * (neck - root), force)], axis=-1)

    def update(
        self, pool: Pool, state: CurriculumState, after: EpisodeState, output: StepOutput
    ) -> tuple[CurriculumState, StepOutput]:
        """The state after the episodes that end with this step, and the output with metrics."""
        progress, output = self._regions(state, after, output)
        if state.success is None:
            return state.replace(regions=progress), output
        cell = self.first_cell(pool, after)
        stood = output.truncated & stands(after.record)
        ended, alone = output.done & runs_to_the_end(after), is_alone(after)
        rate = start_prioritisation.RATE
        success = running_mean(state.success, cell, ended & alone, stood, rate)
        wrench = state.wrench
        if wrench is not None:
            wrench = assistive_wrench.update(wrench, cell, ended & ~alone, stood)
        return CurriculumState(success, wrench, progress), output

    def first_cell(self, pool: Pool, episode: EpisodeState) -> tuple[jax.Array, ...]:
        """Indices [B] of the cells of `start_prioritisation.py` in which the episodes started."""
        begin = (episode.time - episode.record.steps * self.control_dt) / episode.duration
        place = start_prioritisation.place_of(pool, episode.kind, episode.region)
        return place, episode.getup, start_prioritisation.bin_of(begin)

    def _at_frontier(
        self, world: StartWorld, learned: jax.Array, place: jax.Array, key: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        """Styles [B] and rows [B] at the places [B], most of them where success is at stake."""
        weight = start_prioritisation.weights(
            learned,
            world.pool,
            world.duration,
            self.config.prioritisation,
            self.config.even_styles,
            self.config.reference_everywhere,
        )
        return start_prioritisation.draw(weight, place, key)

    def _places(
        self, key: jax.Array, size: int, progress: regions.RegionProgress | None
    ) -> tuple[jax.Array, jax.Array | None]:
        """Kinds of start [B] and regions [B], None on a flat plane."""
        key_kind, key_region = jax.random.split(key)
        draw = jax.random.uniform(key_kind, (size,))
        stand, along = self.stand_start, self.config.reference_start
        kind = jnp.where(draw < stand, STANDING, jnp.where(draw < stand + along, CLIP, LYING))
        kind = kind.astype(jnp.int32)
        if progress is None:
            return kind, None
        region = regions.draw_region(progress, key_region, size, self.config.prioritisation)
        if not self.config.reference_everywhere:
            kind = jnp.where((region > 0) & (kind == CLIP), LYING, kind)
        return kind, region

    def _regions(
        self, state: CurriculumState, after: EpisodeState, output: StepOutput
    ) -> tuple[regions.RegionProgress | None, StepOutput]:
        if self.terrain is None or state.regions is None or after.region is None:
            return None, output
        counts = (after.kind == LYING) & runs_to_the_end(after) & is_alone(after)
        ended, stood = output.done & counts, output.truncated & stands(after.record)
        progress = regions.advance(state.regions, self.terrain, ended, ended & stood, after.region)
        opened = jnp.full(len(ended), progress.opened, jnp.float32)
        return progress, output.replace(metrics=output.metrics | {"regions_open": opened})


def _evenly(
    pool: Pool, region: jax.Array | None, key_style: jax.Array, key_row: jax.Array, size: int
) -> tuple[jax.Array, jax.Array]:
    """Styles [B] and rows [B], each as often; styles that can start in the regions [B]."""
    *_, num_styles, rows = pool.table.shape
    if region is None or pool.startable is None:
        getup = jax.random.randint(key_style, (size,), 0, num_styles)
    else:
        place = jax.random.randint(key_style, (size,), 0, pool.startable.count[region])
        getup = pool.startable.styles[region, place]
    return getup, jax.random.randint(key_row, (size,), 0, rows)
