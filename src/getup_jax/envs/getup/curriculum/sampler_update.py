"""What a batch of training episodes tells about its starts, for those that come next."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from getup_jax.config import TaskConfig, TerrainConfig
from getup_jax.core.types import StepOutput
from getup_jax.envs.getup.curriculum import (
    assistive_wrench,
    regions,
    start_prioritisation,
    success_rate,
)
from getup_jax.envs.getup.episode import EpisodeState, stands
from getup_jax.envs.getup.resets.pool import Pool


def first_cell(pool: Pool, state: EpisodeState, control_dt: float) -> tuple[jax.Array, ...]:
    """Indices [B] of the cells of `start_prioritisation.py` in which the episodes started."""
    begin = (state.time - state.record.steps * control_dt) / state.duration
    place = start_prioritisation.place_of(pool, state.kind, state.region)
    return place, state.getup, start_prioritisation.part_of(begin, state.misfit)


def runs_to_the_end(state: EpisodeState) -> jax.Array:
    """Which episodes [B] can end standing; one that is cut short says nothing about success."""
    whole = jnp.ones(len(state.time), bool)
    return whole if state.until is None else jnp.isinf(state.until)


def is_alone(state: EpisodeState) -> jax.Array:
    """Which episodes [B] have no helping hand."""
    alone = jnp.ones(len(state.time), bool)
    return alone if state.lift is None else state.lift == 0.0


def learned(
    config: TaskConfig, pool: Pool, state: EpisodeState, output: StepOutput, control_dt: float
) -> tuple[jax.Array | None, jax.Array | None]:
    """The focus and the hand's levels [3 R, G, bins] after the episodes that end with this step.

    None where there is no focus, or no hand.
    """
    if state.focus is None:
        return None, None
    cell = first_cell(pool, state, control_dt)
    success = output.truncated & stands(state.record)
    ended = output.done & runs_to_the_end(state)
    alone = is_alone(state)
    after = success_rate.update(
        state.focus, cell, ended & alone, success, start_prioritisation.RATE
    )
    if state.assist is None:
        return after, None
    ended &= ~alone
    return after, assistive_wrench.update(state.assist, cell, ended, success, config.assist_rates)


def progress(
    terrain: TerrainConfig | None, state: EpisodeState, output: StepOutput
) -> tuple[regions.Curriculum | None, StepOutput]:
    """The curriculum after a step, None on a flat plane, and the output with its metrics."""
    if terrain is None or state.curriculum is None or state.region is None:
        return None, output
    verdict = output.episode["success"]
    ended = output.done & ~jnp.isnan(verdict)
    after = regions.advance(state.curriculum, terrain, ended, verdict == 1.0, state.region)
    opened = jnp.full(len(ended), after.opened, jnp.float32)
    return after, output.replace(metrics=output.metrics | {"regions_open": opened})
