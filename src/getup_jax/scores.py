"""Scores of evaluated episodes: success, tracking and how the motion feels."""

from __future__ import annotations

import dataclasses
import io
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import norm

from getup_jax.motion.clips import GetUp

STAND_SHARE = 0.9  # of the curve's end: the character stands from when it stays above this


@dataclasses.dataclass(frozen=True)
class Scores:
    """Means over episodes; NaN where no episode has the quantity."""

    success: float  # share
    success_low: float  # 95 % Wilson interval
    success_high: float
    return_rate: float  # cumulative task reward / steps of the full episode [P 6.4]
    height_error_m: float  # mean |h - p_h| while rising
    angle_error_rad: float  # mean error of the two torso angles while rising
    stand_time_s: float  # until the character stands for good; successful episodes
    jitter: float  # mean |third derivative| of the hinge angles (rad/s^3)
    torque_nm: float  # mean |torque| of a hinge
    energy_j: float  # integral of sum |torque x rate| over the episode
    episodes: int
    per_curve: dict[str, Scores] | None = None


def score(
    trace: Any,
    getup: np.ndarray,
    getups: Sequence[GetUp],
    control_dt: float,
    stand_time_s: float,
) -> Scores:
    """Scores of a trace (see `evaluate.Trace`, NumPy leaves [T, N, ...]) in total and by style."""
    values = episode_values(trace, control_dt, stand_time_s)
    per_curve = {
        style.name: _mean({name: x[getup == i] for name, x in values.items()})
        for i, style in enumerate(getups)
        if (getup == i).any()
    }
    return dataclasses.replace(_mean(values), per_curve=per_curve)


def episode_values(trace: Any, control_dt: float, stand_time_s: float) -> dict[str, np.ndarray]:
    """One number an episode [N] of everything that `Scores` averages."""
    running, rising = trace.running, trace.running & (trace.time <= trace.duration)
    error = np.abs(trace.features - trace.target)
    power = np.abs(trace.torque * trace.qvel[..., 6:]).sum(axis=-1)
    rate = trace.qvel[..., 6:]
    jerk = np.abs(np.diff(rate, n=2, axis=0)).mean(axis=-1) / control_dt**2
    success = trace.success.any(axis=0)
    start = trace.time[0] - control_dt  # a standing start begins at the curve's end
    full_steps = np.round((trace.duration[0] + stand_time_s - start) / control_dt)
    return {
        "success": success.astype(float),
        "return_rate": np.where(running, trace.task_reward, 0.0).sum(axis=0) / full_steps,
        "height_error_m": _masked_mean(error[..., 0], rising),
        "angle_error_rad": _masked_mean(error[..., 1:].mean(axis=-1), rising),
        "stand_time_s": np.where(success, stand_time(trace), np.nan),
        "jitter": _masked_mean(jerk, running[2:]),
        "torque_nm": _masked_mean(np.abs(trace.torque).mean(axis=-1), running),
        "energy_j": np.where(running, power, 0.0).sum(axis=0) * control_dt,
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
    z = float(norm.ppf(0.5 + confidence / 2))
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
    for part in (result["per_curve"] or {}).values():
        del part["per_curve"]
    return result


def table(scores: Scores) -> str:
    """The scores as a text table, one row a style and one in total."""
    columns = {
        "success": "{:.0%}", "95 %": "", "return_rate": "{:.2f}", "height_error_m": "{:.3f}",
        "angle_error_rad": "{:.2f}", "stand_time_s": "{:.1f}", "jitter": "{:.0f}",
        "torque_nm": "{:.1f}", "energy_j": "{:.0f}", "episodes": "{:d}",
    }  # fmt: skip
    view = Table()
    view.add_column("get-up", no_wrap=True)
    for name in columns:
        view.add_column(name.replace("_", " "))
    for name, row in {**(scores.per_curve or {}), "all": scores}.items():
        if name == "all":
            view.add_section()
        interval = f"{row.success_low:.0%}-{row.success_high:.0%}"
        cells = [
            interval if column == "95 %" else text.format(getattr(row, column))
            for column, text in columns.items()
        ]
        view.add_row(name, *cells)
    out = io.StringIO()
    Console(file=out, width=170).print(view)
    return out.getvalue()


def _mean(values: dict[str, np.ndarray]) -> Scores:
    episodes = len(values["success"])
    low, high = wilson(float(values["success"].sum()), episodes)
    means: dict[str, Any] = {
        name: float(np.nanmean(x)) if np.isfinite(x).any() else math.nan
        for name, x in values.items()
    }
    return Scores(success_low=low, success_high=high, episodes=episodes, **means)


def _masked_mean(value: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Mean [N] of value [T, N] where mask; NaN where the mask is empty."""
    count = mask.sum(axis=0)
    total = np.where(mask, value, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
