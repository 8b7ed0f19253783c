"""Pictures of style curves: classes of get-ups [P figure 8], and each fit over its clip."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from getup_jax.core.output_file import replacing
from getup_jax.motion.clips import GetUp, MotionError
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.events import link_positions
from getup_jax.motion.getup.getups import clip_features
from getup_jax.motion.getup.strategies import classify
from getup_jax.physics.character import CharacterSpec

_LABELS = ("neck height (m)", "side to up (deg)", "front to up (deg)")
_SCALE = np.array([1.0, 180 / np.pi, 180 / np.pi])
_PHASE = np.linspace(0.0, 1.0, 101)


def plot_getups(getups: Sequence[GetUp], character: CharacterSpec, file: Path) -> None:
    """Write one PNG: mean and deviation of each strategy on top, below it one row a get-up."""
    if not getups:
        raise MotionError("plot: no get-ups to draw")
    pyplot = _pyplot()
    classes = class_curves(getups)
    rows = len(classes) + len(getups)
    figure, axes = pyplot.subplots(rows, 3, figsize=(11, 1.9 * rows), squeeze=False)
    for row, (name, values) in zip(axes, classes.items(), strict=False):
        _draw_class(row, name, values)
    for row, getup in zip(axes[len(classes) :], getups, strict=True):
        _draw_fit(row, getup, character)
    axes[len(classes)][0].legend(fontsize=6)
    for axis, label in zip(axes[0], _LABELS, strict=True):
        axis.set_title(label)
    figure.tight_layout()
    file.parent.mkdir(parents=True, exist_ok=True)
    with replacing(file) as part:
        figure.savefig(part, dpi=90)
    pyplot.close(figure)


def plot_strategies(getups: Sequence[GetUp], character: CharacterSpec, file: Path) -> None:
    """Write one PNG as [P figure 8]: a row a strategy, mean and deviation over the phase.

    The classes are those of `classify`. Get-ups without a motion are left out, and those that
    turn to the left are drawn as their mirror images, so that both sides have one mean.
    """
    classes = strategy_curves(getups, character)
    if not classes:
        raise MotionError("plot --strategies: no get-ups with a motion; leave the flag out")
    pyplot = _pyplot()
    size = (11, 2.1 * len(classes) + 0.4)
    figure, axes = pyplot.subplots(len(classes), 3, figsize=size, squeeze=False, sharex=True)
    for row, (name, values) in zip(axes, classes.items(), strict=True):
        _draw_class(row, name, values)
        for column, axis in enumerate(row):
            axis.plot(_PHASE, values[..., column].T, "k", linewidth=0.6, alpha=0.35)
    for axis, label in zip(axes[0], _LABELS, strict=True):
        axis.set_title(label)
    for axis in axes[-1]:
        axis.set_xlabel("phase t / T")
    figure.tight_layout()
    file.parent.mkdir(parents=True, exist_ok=True)
    with replacing(file) as part:
        figure.savefig(part, dpi=80)
    pyplot.close(figure)


def strategy_curves(getups: Sequence[GetUp], character: CharacterSpec) -> dict[str, np.ndarray]:
    """{strategy: curves [n, 101, 3]} of the get-ups with a motion, all turning to the right."""
    named = []
    for getup in getups:
        if getup.clip is not None:
            positions = link_positions(getup.clip, character)
            name = classify(positions, getup.clip.fps, character)
            named.append(dataclasses.replace(getup, strategy=name))
    classes = class_curves(named) if named else {}
    for values in classes.values():
        left = values[..., 1].mean(axis=1) < 90.0
        values[left, :, 1] = 180.0 - values[left, :, 1]
    return classes


def class_curves(getups: Sequence[GetUp]) -> dict[str, np.ndarray]:
    """{strategy: curves [n, 101, 3] over the phase}, in the plot's units."""
    points = np.stack([getup.points for getup in getups])
    weights = curves.basis(_PHASE)
    values = np.einsum("sp,gpd->gsd", weights, points) * _SCALE
    names = [getup.strategy or "unclassified" for getup in getups]
    return {
        name: values[[i for i, other in enumerate(names) if other == name]]
        for name in sorted(set(names))
    }


def _draw_class(row: Any, name: str, values: np.ndarray) -> None:
    mean, deviation = values.mean(axis=0), values.std(axis=0)
    for column, axis in enumerate(row):
        low, high = (mean[:, column] + sign * deviation[:, column] for sign in (-1, 1))
        axis.fill_between(_PHASE, low, high, alpha=0.3)
        axis.plot(_PHASE, mean[:, column])
        _finish(axis, column)
    row[0].set_ylabel("\n".join(textwrap.wrap(name, 18)) + f"\n(n = {len(values)})", fontsize=8)


def _draw_fit(row: Any, getup: GetUp, character: CharacterSpec) -> None:
    fitted = curves.basis(_PHASE) @ getup.points * _SCALE
    knots = np.linspace(0.0, getup.duration, len(getup.points))
    for column, axis in enumerate(row):
        axis.plot(_PHASE * getup.duration, fitted[:, column], label="spline")
        axis.plot(knots, getup.points[:, column] * _SCALE[column], "o", markersize=3)
        _finish(axis, column)
    if getup.clip is not None:
        values = clip_features(link_positions(getup.clip, character), character) * _SCALE
        times = np.arange(len(values)) / getup.clip.fps
        for column, axis in enumerate(row):
            axis.plot(times, values[:, column], "k", linewidth=0.8, alpha=0.6, label="clip")
    row[0].set_ylabel(f"{getup.name}\n{getup.strategy}", fontsize=6)


def _finish(axis: Any, column: int) -> None:
    axis.set_ylim((0.0, 1.7) if column == 0 else (0.0, 180.0))
    axis.grid(alpha=0.3)


def _pyplot() -> Any:
    try:
        import matplotlib
    except ImportError:
        raise MotionError(
            "plot: matplotlib is not installed; pip install 'getup-jax[plot]'"
        ) from None
    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot
