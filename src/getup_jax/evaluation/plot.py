"""Target and achieved curves of evaluated episodes, with pictures along the time axis."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from getup_jax.config import ConfigError
from getup_jax.core.output_file import replacing
from getup_jax.evaluation.film import render, typical
from getup_jax.evaluation.rollout import Episodes
from getup_jax.motion.getup import curves

STYLES = 5  # columns at most
PICTURES = 6  # of one episode, along the time axis
_PICTURE_SIZE = (360, 150)  # rows, columns
_ROWS = ("neck height (m)", "side to up (deg)", "front to up (deg)")
_SCALE = np.array([1.0, 180 / np.pi, 180 / np.pi])


def plot(path: Path, result: Episodes) -> None:
    """Write a column a style: height, side and front angle over time, pictures below.

    The pictures are of a typical episode (see `video.typical`); without a renderer they are
    left out, with a warning.
    """
    pyplot = require()
    chosen = typical(result, STYLES)
    strips = _strips(result, chosen)
    heights = [2, 2, 2] + ([1.6] if strips else [])
    figure, axes = pyplot.subplots(
        len(heights),
        len(chosen),
        figsize=(4.2 * len(chosen) + 0.6, 1.2 * sum(heights)),
        squeeze=False,
        height_ratios=heights,
        layout="constrained",
    )
    for column, episode in enumerate(chosen):
        _draw_curves(axes[:3, column], result, episode)
        if strips:
            _draw_strip(axes[3, column], axes[0, column].get_xlim(), *strips[column])
    for axis, name in zip(axes[:3, 0], _ROWS, strict=True):
        axis.set_ylabel(name)
    axes[0, 0].legend(fontsize=7, loc="lower right")
    with replacing(path) as part:
        figure.savefig(part, dpi=110)
    pyplot.close(figure)


def band(
    features: np.ndarray, running: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Mean, 10th and 90th percentile [t, 3] of features [T, N, 3] over the running episodes.

    And their number [t]; t ends where none is left.
    """
    left = running.any(axis=1)
    values = np.where(running[left][..., None], features[left], np.nan)
    low, high = np.nanpercentile(values, [10, 90], axis=1)
    return np.nanmean(values, axis=1), low, high, running[left].sum(axis=1)


def _draw_curves(axes: Any, result: Episodes, episode: int) -> None:
    """Mean and band of the episodes of one style while they run, and the target of one of them."""
    trace, style = result.trace, result.getup[episode]
    of_style = np.flatnonzero(result.getup == style)
    running = trace.running[:, of_style]
    mean, low, high, left = band(trace.features[:, of_style] * _SCALE, running)
    env = result.task.environment
    start, duration = trace.time[0, episode], trace.duration[0, episode]
    time = start + env.engine.control_dt * np.arange(len(mean))
    goal_time = np.linspace(start, duration + env.config.stand_time_s, 200)
    target = curves.basis(goal_time / duration) @ result.styles[style].points * _SCALE
    for row, axis in enumerate(axes):
        axis.fill_between(time, low[:, row], high[:, row], alpha=0.3, label="10 to 90 %")
        axis.plot(time, mean[:, row], label="achieved, mean")
        axis.plot(goal_time, target[:, row], "k--", linewidth=1, label="target")
        axis.axvline(duration, color="0.6", linewidth=0.8)
        axis.set_ylim((0.0, 1.7) if row == 0 else (0.0, 180.0))
        axis.set_xlim(goal_time[0], goal_time[-1])
        axis.grid(alpha=0.3)
    stood = int(trace.success[:, of_style].any(axis=0).sum())
    title = f"{result.styles[style].name}\n{stood} of {len(of_style)} stand, {left[-1]} to the end"
    axes[0].set_title(title, fontsize=8)
    axes[-1].set_xlabel("time (s)")


def _strips(result: Episodes, chosen: list[int]) -> list[tuple[np.ndarray, list[np.ndarray]]]:
    """Times and pictures of every chosen episode; empty where this machine cannot render."""
    trace, model = result.trace, result.task.environment.character.model
    strips = []
    for episode in chosen:
        steps = np.flatnonzero(trace.running[:, episode])
        steps = steps[np.linspace(0, len(steps) - 1, PICTURES).round().astype(int)]
        try:
            images = render(model, trace.qpos[steps, episode], _PICTURE_SIZE)
        except ConfigError as error:
            warnings.warn(f"--plot: without pictures: {error}", RuntimeWarning, stacklevel=3)
            return []
        strips.append((trace.time[steps, episode], images))
    return strips


def _draw_strip(
    axis: Any, limits: tuple[float, float], times: np.ndarray, images: list[np.ndarray]
) -> None:
    """The pictures side by side, each under a tick with its time."""
    axis.imshow(np.concatenate(images, axis=1), aspect="auto", extent=(*limits, 0.0, 1.0))
    width = (limits[1] - limits[0]) / len(images)
    centres = limits[0] + width * (np.arange(len(images)) + 0.5)
    axis.set_xticks(centres, [f"{t:.1f} s" for t in times], fontsize=7)
    axis.set_yticks([])


def require() -> Any:
    """Matplotlib's pyplot, or ConfigError that says how to get it."""
    try:
        import matplotlib
    except ImportError as error:
        raise ConfigError(
            "--plot: needs matplotlib; install the extra: pip install 'getup-jax[plot]'"
        ) from error
    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot
