"""The state of a batch of get-up episodes, their early ends and their verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.core.types import PhysicsState
from getup_jax.envs.getup.curriculum.state import CurriculumState
from getup_jax.runtime.pytree_store import from_nested

# kinds of start, in the order of the pool's table
LYING, STANDING, CLIP = 0, 1, 2

STAND_LOWEST = 0.85  # of the curve's end, throughout the last second
STAND_MEAN = 0.9  # of the curve's end, on average over the standing phase
LAST_S = 1.0  # s, the part of the standing phase that STAND_LOWEST looks at


@struct.dataclass
class Record:
    """Sums over one episode so far."""

    task_reward: jax.Array  # [B] sum of the task reward
    stand_ratio: jax.Array  # [B] sum of height / curve end over the standing phase
    stand_steps: jax.Array  # [B] int32 steps of the standing phase
    last_ratio: jax.Array  # [B] lowest height / curve end of the last second
    height_error: jax.Array  # [B] sum of |h - p_h| while rising (m)
    angle_error: jax.Array  # [B] sum of the mean torso angle error while rising (rad)
    rise_steps: jax.Array  # [B] int32 steps while rising

    @classmethod
    def empty(cls, size: int) -> Record:
        """Sums of nothing."""
        zero, none = jnp.zeros(size, jnp.float32), jnp.zeros(size, jnp.int32)
        return cls(zero, zero, none, jnp.full(size, jnp.inf, jnp.float32), zero, zero, none)

    @property
    def steps(self) -> jax.Array:
        """Control steps [B] int32 that were taken."""
        return self.rise_steps + self.stand_steps


@struct.dataclass
class EpisodeState:
    """B episodes between two steps."""

    physics: PhysicsState
    observation: jax.Array  # [B, O]
    action: jax.Array  # [B, A] filtered action y
    getup: jax.Array  # [B] int32, index of the style
    kind: jax.Array  # [B] int32, LYING, STANDING or CLIP
    time: jax.Array  # [B] s since the curve's start, t - t0 of equation 1
    points: jax.Array  # [B, 9, 3] control points of the curves: m, rad, rad
    duration: jax.Array  # [B] s, T
    low_steps: jax.Array  # [B] int32, steps in a row with a low task reward
    head_steps: jax.Array  # [B] int32, steps in a row with the head on the floor
    record: Record
    key: jax.Array
    # [B] s, time on the curve at which a short episode is cut, inf: at its end; None: all are
    until: jax.Array | None = None
    lift: jax.Array | None = None  # [B] N, most of the assistive wrench; None: there is none
    # [B, J] rad, what the filter has left of the offsets that held the start pose; None: of none
    start_offset: jax.Array | None = None
    # Irregular ground only; None on a flat plane.
    region: jax.Array | None = None  # [B] int32, where the episode started
    curriculum: CurriculumState | None = None  # of the whole batch


def with_shared(state: EpisodeState, nested: Mapping[str, Any], where: str) -> EpisodeState:
    """The state with the curriculum of another batch, nested arrays from the file `where`.

    Raises CheckpointError where the other batch had another task.
    """
    curriculum = nested.get("curriculum") or {}
    return state.replace(curriculum=from_nested(state.curriculum, curriculum, where))


def recorded(
    state: EpisodeState,
    value: jax.Array,
    target: jax.Array,
    task_reward: jax.Array,
    stand_time_s: float,
) -> EpisodeState:
    """The state with a step's features [B, 3], their targets [B, 3] and reward [B] recorded."""
    record = update_record(
        state.record,
        value,
        target,
        state.points[:, -1, 0],
        state.duration + stand_time_s - state.time,
        state.time > state.duration,
        task_reward,
    )
    return state.replace(record=record)


def update_record(
    record: Record,
    value: jax.Array,
    target: jax.Array,
    final_height: jax.Array,
    time_left: jax.Array,
    standing: jax.Array,
    task_reward: jax.Array,
) -> Record:
    """Add one step: features value [B, 3], their targets [B, 3], time_left [B] to the end (s)."""
    ratio = value[:, 0] / final_height
    rising = ~standing
    last = standing & (time_left < LAST_S)
    error = jnp.abs(value - target)
    return Record(
        task_reward=record.task_reward + task_reward,
        stand_ratio=record.stand_ratio + jnp.where(standing, ratio, 0.0),
        stand_steps=record.stand_steps + standing.astype(jnp.int32),
        last_ratio=jnp.where(last, jnp.minimum(record.last_ratio, ratio), record.last_ratio),
        height_error=record.height_error + jnp.where(rising, error[:, 0], 0.0),
        angle_error=record.angle_error + jnp.where(rising, error[:, 1:].mean(axis=1), 0.0),
        rise_steps=record.rise_steps + rising.astype(jnp.int32),
    )


def stands(record: Record) -> jax.Array:
    """Whether the standing phase counts as standing; meaningful at an episode's end."""
    mean = record.stand_ratio / jnp.maximum(record.stand_steps, 1)
    reached = jnp.isfinite(record.last_ratio)
    return reached & (record.last_ratio >= STAND_LOWEST) & (mean >= STAND_MEAN)


def runs_to_the_end(state: EpisodeState) -> jax.Array:
    """Which episodes [B] can end standing; one that is cut short says nothing about success."""
    whole = jnp.ones(len(state.time), bool)
    return whole if state.until is None else jnp.isinf(state.until)


def is_alone(state: EpisodeState) -> jax.Array:
    """Which episodes [B] have no assistive wrench."""
    alone = jnp.ones(len(state.time), bool)
    return alone if state.lift is None else state.lift == 0.0


def full_steps(state: EpisodeState, stand_s: float, control_dt: float) -> jax.Array:
    """Steps [B] that an episode with this start has, if it does not end early."""
    left = state.duration + stand_s - state.time
    return state.record.steps + jnp.round(left / control_dt)


def verdict(state: EpisodeState, truncated: jax.Array, full_steps: jax.Array) -> dict:
    """Metrics of episodes that end at this step; NaN where one does not apply.

    One that was cut short, or that had help, says nothing. full_steps [B] is the length of the
    episode had it not ended early: the average return rate is the cumulative task reward over it
    [P 6.4].
    """
    record = state.record
    success = (truncated & stands(record)).astype(jnp.float32)
    rise = jnp.maximum(record.rise_steps, 1)
    rose = record.rise_steps > 0
    found = {
        "success": jnp.where(state.kind == LYING, success, jnp.nan),
        "stand_success": jnp.where(state.kind == STANDING, success, jnp.nan),
        "clip_success": jnp.where(state.kind == CLIP, success, jnp.nan),
        "return_rate": record.task_reward / full_steps,
        "return_rate_lying": jnp.where(
            state.kind == LYING, record.task_reward / full_steps, jnp.nan
        ),
        "height_error_m": jnp.where(rose, record.height_error / rise, jnp.nan),
        "angle_error_rad": jnp.where(rose, record.angle_error / rise, jnp.nan),
    }
    if state.until is None and state.lift is None:
        return found
    counts = runs_to_the_end(state) & is_alone(state)
    return {name: jnp.where(counts, x, jnp.nan) for name, x in found.items()}
