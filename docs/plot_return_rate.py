"""Draw the average return rate of training runs over control steps, as figure 10 of the paper.

    python docs/plot_return_rate.py runs/ablation_* [--out return_rate.png] [--smooth 0.02]

Reads metrics.jsonl of every run folder. The average return rate is the cumulative task reward of
an episode over the steps that it has if it does not end early. Dotted lines show where a run
opened another region of the ground. Needs matplotlib: pip install 'getup-jax[plot]'.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from getup_jax.runtime.metric_file import read_metrics

METRIC, OPENED = "episode/return_rate", "rollout/regions_open"


def main(argv: Sequence[str] | None = None) -> int:
    """Draw the runs and print the last value of each; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="run folders")
    parser.add_argument("--out", type=Path, default=Path("return_rate.png"), metavar="FILE")
    parser.add_argument("--metric", default=METRIC, help=f"(default: {METRIC})")
    help_smooth = "width of the moving average as a share of the longest run (default: 0.02)"
    parser.add_argument("--smooth", type=float, default=0.02, metavar="S", help=help_smooth)
    args = parser.parse_args(argv)
    try:
        curves = {run.name: curve(read_metrics(run), args.metric) for run in args.runs}
    except (FileNotFoundError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    width = args.smooth * max(steps[-1] for steps, _, _ in curves.values())
    curves = {
        name: (steps, smoothed(steps, value, width), opened)
        for name, (steps, value, opened) in curves.items()
    }
    draw(curves, args.metric, args.out)
    for name, (steps, value, _) in curves.items():
        print(f"{name}: {value[-1]:.3f} after {steps[-1]:,.0f} steps")
    print(args.out)
    return 0


def curve(rows: list[dict[str, Any]], metric: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Steps [N], values [N] where the metric is known, and the steps where a region opened."""
    if not rows or metric not in rows[-1]:
        known = sorted(name for name in (rows[-1] if rows else {}) if name.startswith("episode/"))
        raise ValueError(
            f"{metric}: not in the metrics, which have {', '.join(known) or 'no rows'}"
        )
    known = [row for row in rows if not math.isnan(row.get(metric, math.nan))]
    if not known:
        raise ValueError(f"{metric}: no episode has ended yet")
    # a logged line is a mean over iterations, so a region opens where it passes a whole number
    opened = np.floor([row.get(OPENED, 1.0) + 1e-6 for row in rows])
    steps = np.array([row["steps"] for row in rows], float)
    return (
        np.array([row["steps"] for row in known], float),
        np.array([row[metric] for row in known]),
        steps[1:][np.diff(opened) > 0],
    )


def smoothed(steps: np.ndarray, value: np.ndarray, width: float) -> np.ndarray:
    """Mean of the values [N] within half a width (steps) to both sides."""
    total = np.concatenate([[0.0], np.cumsum(value)])
    low = np.searchsorted(steps, steps - width / 2, side="left")
    high = np.searchsorted(steps, steps + width / 2, side="right")
    return (total[high] - total[low]) / (high - low)


def draw(
    curves: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]], metric: str, file: Path
) -> None:
    """Write the picture: name -> (steps, values, steps where a region opened)."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7.0, 4.0), layout="constrained")
    for name, (steps, value, opened) in curves.items():
        (line,) = axes.plot(steps / 1e6, value, label=name)
        for step in opened:
            axes.axvline(step / 1e6, color=line.get_color(), linestyle=":", linewidth=0.8)
    axes.set(xlabel="control steps (million)", ylabel=metric.rpartition("/")[2].replace("_", " "))
    axes.set_ylim(0.0, None)
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(file, dpi=150)


if __name__ == "__main__":
    sys.exit(main())
