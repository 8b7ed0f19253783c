"""What helps to train, as one object: it draws the starts, and learns from the episodes that end.

The environment knows states, rewards and ends; which starts come how often, which of them have the
assistive wrench or are cut short, and which regions are open, is decided here.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp

from getup_jax.config import CurriculumConfig, TerrainConfig
from getup_jax.core.types import StepOutput
from getup_jax.envs.getup.curriculum import (
    assistive_wrench,
    regions,
    start_prioritisation,
    start_sampler,
    success_rate,
)
from getup_jax.envs.getup.curriculum.start_sampler import Draw, StartWorld
from getup_jax.envs.getup.curriculum.state import CurriculumState
from getup_jax.envs.getup.episode import LYING, EpisodeState, stands
from getup_jax.envs.getup.resets.pool import Pool


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
        """What `size` episodes start from, on the curves of their styles; see `with_curves`."""
        return start_sampler.draw_starts(self.config, self.stand_start, world, key, size, state)

    def with_curves(
        self, world: StartWorld, key: jax.Array, drawn: Draw, first: jax.Array | int = 0
    ) -> Draw:
        """The starts with the share of drawn curves that is asked for."""
        match_rad = self.curve_match_rad
        return start_sampler.with_curves(self.config, match_rad, world, key, drawn, first)

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
        success = success_rate.update(state.success, cell, ended & alone, stood, rate)
        wrench = state.wrench
        if wrench is not None:
            wrench = assistive_wrench.update(wrench, cell, ended & ~alone, stood)
        return CurriculumState(success, wrench, progress), output

    def first_cell(self, pool: Pool, episode: EpisodeState) -> tuple[jax.Array, ...]:
        """Indices [B] of the cells of `start_prioritisation.py` in which the episodes started."""
        begin = (episode.time - episode.record.steps * self.control_dt) / episode.duration
        place = start_prioritisation.place_of(pool, episode.kind, episode.region)
        return place, episode.getup, start_prioritisation.bin_of(begin)

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


def runs_to_the_end(episode: EpisodeState) -> jax.Array:
    """Which episodes [B] can end standing; one that is cut short says nothing about success."""
    whole = jnp.ones(len(episode.time), bool)
    return whole if episode.until is None else jnp.isinf(episode.until)


def is_alone(episode: EpisodeState) -> jax.Array:
    """Which episodes [B] have no assistive wrench."""
    alone = jnp.ones(len(episode.time), bool)
    return alone if episode.lift is None else episode.lift == 0.0
