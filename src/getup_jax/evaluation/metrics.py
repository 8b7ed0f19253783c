"""Scores of evaluated episodes: success, tracking and how the motion feels."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import ndtri

from getup_jax.envs.getup.episode import LYING
from getup_jax.evaluation.ground_kinds import Places, kinds
from getup_jax.evaluation.scenario import orientation
from getup_jax.motion.clips import GetUp
from getup_jax.physics.terrain_map import REGIONS

ORIENTATIONS = ("supine", "prone", "side")
_SUMMED = ("task_return", "full_steps")  # of `episode_values`, over all episodes
STAND_SHARE = 0.9  # of the curve's end: the character stands from when it stays above this


@dataclasses.dataclass(frozen=True)
class Scores:
    """Means over episodes; NaN where no episode has the quantity."""

    success: float  # share
    success_low: float  # 95 % Wilson interval
    success_high: float
    return_rate: float  # cumulative task reward / steps of the full episode, mean of the episodes
    return_rate_total: float  # task reward of all episodes / steps of all full episodes [P 6.4]
    height_error_m: float  # mean |h - p_h| while rising
    angle_error_rad: float  # mean error of the two torso angles while rising
    stand_time_s: float  # until the character stands for good; successful episodes
    jitter: float  # mean |third derivative| of the hinge angles (rad/s^3)
    torque_nm: float  # mean |torque| of a hinge
    energy_j: float  # integral of sum |torque x rate| over the episode
    saturation: float  # share of hinges and steps with the torque at its limit
    offset_rad: float  # mean |dq|_1 of the filtered offsets
    foot_slip_m_s: float  # mean horizontal speed of the feet's points on the ground
    penetration_m: float  # mean over looks at the deepest overlap of two links
    penetration_max_m: float  # deepest overlap of all
    reference_error_m: float  # mean distance of a link to the style's own motion, time warped
    success_pushed: float  # share of success among the episodes that were pushed
    episodes: int
    per_orientation: dict[str, Scores] | None = None  # supine, prone, side: how the curve starts
    per_curve: dict[str, Scores] | None = None
    per_region: dict[str, Scores] | None = None  # of irregular ground, where an episode starts
    per_ground: dict[str, Scores] | None = None  # flat, rough or how steep it is there


def score(
    values: dict[str, np.ndarray],
    getup: np.ndarray,
    getups: Sequence[GetUp],
    kind: int = LYING,
    places: Places | None = None,
) -> Scores:
    """Scores of episodes, of what `episode_values` says of each [N], and their styles [N].

    In total, by style, for lying starts by how the body lies, and on irregular ground by region
    and kind of ground.
    """
    styles = np.array([style.name for style in getups])[getup]
    lies = np.array([orientation(style) for style in getups])[getup]
    return dataclasses.replace(
        _mean(values),
        per_orientation=_split(values, lies, ORIENTATIONS) if kind == LYING else None,
        per_curve=_split(values, styles, [style.name for style in getups]),
        per_region=None if places is None else _split(values, places.region, REGIONS),
        per_ground=None if places is None else _split(values, places.kind, kinds()),
    )


def _split(
    values: dict[str, np.ndarray], group: np.ndarray, names: Sequence[str]
) -> dict[str, Scores]:
    """Scores of every group that has an episode; group [N] has the name of each episode's."""
    return {
        name: _mean({key: x[group == name] for key, x in values.items()})
        for name in names
        if (group == name).any()
    }


def episode_values(trace: Any, control_dt: float, stand_time_s: float) -> dict[str, np.ndarray]:
    """One number an episode [N] of everything that `Scores` is made of.

    Of a trace as `rollout.Trace`, with NumPy leaves [T, N, ...].
    """
    running, rising = trace.running, trace.running & (trace.time <= trace.duration)
    error = np.abs(trace.features - trace.target)
    success = trace.success.any(axis=0)
    start = trace.time[0] - control_dt  # a standing start begins at the curve's end
    full_steps = np.round((trace.duration[0] + stand_time_s - start) / control_dt)
    task_return = np.where(running, trace.task_reward, 0.0).sum(axis=0)
    return {
        "success": success.astype(float),
        "return_rate": task_return / full_steps,
        "task_return": task_return,
        "full_steps": full_steps,
        "height_error_m": _masked_mean(error[..., 0], rising),
        "angle_error_rad": _masked_mean(error[..., 1:].mean(axis=-1), rising),
        "stand_time_s": np.where(success, stand_time(trace), np.nan),
        "jitter": _masked_mean(trace.jerk, running),
        "torque_nm": _masked_mean(trace.torque, running),
        "energy_j": np.where(running, trace.power, 0.0).sum(axis=0) * control_dt,
        "saturation": _masked_mean(trace.saturation, running),
        "offset_rad": _masked_mean(trace.offset, running),
        "foot_slip_m_s": _masked_mean(trace.slip, running),
        "penetration_m": _masked_mean(trace.penetration, running),
        "penetration_max_m": _masked_max(trace.penetration, running),
        "reference_error_m": np.full(len(success), np.nan),  # see reference_error.py
        "success_pushed": np.where((trace.pushed & running).any(axis=0), success, np.nan),
    }


def stand_time(trace: Any) -> np.ndarray:
    """Time [N] (s) after which the height stays above its share of the curve's end."""
    final = np.where(trace.running, trace.time, -np.inf).argmax(axis=0)
    episodes = np.arange(trace.running.shape[1])
    end = trace.target[final, episodes, 0]
    low = trace.running & (trace.features[..., 0] < STAND_SHARE * end)
    last_low = np.where(low, trace.time, 0.0).max(axis=0)
    return last_low


def wilson(successes: float, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson score interval of a share; (nan, nan) without trials."""
    if trials == 0:
        return math.nan, math.nan
    z = float(ndtri(0.5 + confidence / 2))
    share = successes / trials
    centre = (share + z**2 / (2 * trials)) / (1 + z**2 / trials)
    spread = share * (1 - share) / trials + z**2 / (4 * trials**2)
    half = z * math.sqrt(spread) / (1 + z**2 / trials)
    return max(0.0, centre - half), min(1.0, centre + half)


def to_json(scores: Scores) -> dict[str, Any]:
    """Nested dict of plain numbers; NaN becomes null."""

    def clean(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: clean(item) for name, item in value.items()}
        return None if isinstance(value, float) and math.isnan(value) else value

    result = clean(dataclasses.asdict(scores))
    groups = ("per_orientation", "per_curve", "per_region", "per_ground")
    for group in groups:
        for part in (result[group] or {}).values():
            for inner in groups:
                del part[inner]
    return result


def _mean(values: dict[str, np.ndarray]) -> Scores:
    episodes = len(values["success"])
    low, high = wilson(float(values["success"].sum()), episodes)
    sums = {name: float(values[name].sum()) for name in _SUMMED}
    means: dict[str, Any] = {
        name: _finite_mean(x) for name, x in values.items() if name not in sums
    }
    means["return_rate_total"] = sums["task_return"] / sums["full_steps"]
    deepest = values["penetration_max_m"]
    known = np.isfinite(deepest)
    means["penetration_max_m"] = float(deepest[known].max()) if known.any() else math.nan
    return Scores(success_low=low, success_high=high, episodes=episodes, **means)


def _finite_mean(x: np.ndarray) -> float:
    return float(np.nanmean(x)) if np.isfinite(x).any() else math.nan


def _masked_mean(value: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Mean [N] of value [T, N] where mask and not NaN; NaN where there is nothing."""
    mask = mask & ~np.isnan(value)
    count = mask.sum(axis=0)
    total = np.where(mask, value, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _masked_max(value: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Largest [N] of value [T, N] where mask and not NaN; NaN where there is nothing."""
    mask = mask & ~np.isnan(value)
    largest = np.where(mask, value, -np.inf).max(axis=0)
    return np.where(mask.any(axis=0), largest, np.nan)
