"""What a run writes down about its iterations: means to metrics.jsonl and to the display."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence

import numpy as np

from getup_jax.runtime.console import Display
from getup_jax.runtime.metric_file import MetricsWriter, NoMetrics

REWARD = "rollout/reward_"  # of every step, so never NaN for want of an episode that ended


class MetricLog:
    """Collects the metrics of iterations and logs their means with the speed.

    Args:
        writer: gets one line a `flush`.
        display: shows the same line.
        per_iteration: control steps of one iteration.
        done: iterations done before.
    """

    def __init__(
        self, writer: MetricsWriter | NoMetrics, display: Display, per_iteration: int, done: int
    ) -> None:
        self._writer, self._display = writer, display
        self._per_iteration = per_iteration
        self._rows: list[Mapping[str, float]] = []
        self._wall_before_s = writer.wall_s
        self._begin = self._last = (done, time.monotonic())

    def add(self, metrics: Mapping[str, float]) -> list[str]:
        """Take an iteration's metrics; returns the names of those that say it diverged."""
        self._rows.append(metrics)
        return [name for name, value in metrics.items() if _diverged(name, value)]

    def flush(self, done: int) -> None:
        """Log what came since the last time, if anything; `done` iterations are done."""
        if not self._rows:
            return
        now = (done, time.monotonic())
        metrics = {**means(self._rows), "steps_per_s": self._speed(self._last, now)}
        wall_s = self._wall_before_s + now[1] - self._begin[1]
        steps = done * self._per_iteration
        self._writer.write(done, steps, wall_s, metrics)
        self._display.update(steps, self._speed(self._begin, now), metrics)
        self._rows, self._last = [], now

    def _speed(self, since: tuple[int, float], now: tuple[int, float]) -> float:
        """Control steps a second between two (iteration, time) marks."""
        return (now[0] - since[0]) * self._per_iteration / max(now[1] - since[1], 1e-9)


def means(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Per name the mean over the rows, without NaNs; NaN where there is nothing else."""
    result = {}
    for name in rows[-1]:
        values = np.array([row[name] for row in rows])
        known = values[~np.isnan(values)]
        result[name] = float(known.mean()) if known.size else math.nan
    return result


def _diverged(name: str, value: float) -> bool:
    """Whether a metric says that learning broke; NaN is fair where no episode ended."""
    watched = name.startswith(REWARD) or "loss" in name or "gradient_norm" in name
    return watched and not math.isfinite(value)
