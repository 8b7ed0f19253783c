"""Draw imitation error over control steps of composite runs, as figures 10 and 11 of the paper.

    python docs/plot_imitation_error.py "with MO=runs/mo_0,runs/mo_1" "w/o MO=runs/sum_0,runs/sum_1"
    python docs/plot_imitation_error.py incremental=runs/on_walk scratch=runs/scratch --goals

Every checkpoint that a run folder keeps is evaluated as by getup-eval; train with train.keep=1000.
Runs behind one name are seeds: the line is their mean, the band one standard deviation. A panel is
a motion group (error in m; travel: how far the links move, as a share of what they
do in the clips), or with --goals also a goal (mean reward). What was evaluated is kept in
imitation_error.json of each run folder. Needs matplotlib: pip install 'getup-jax[plot]'.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from getup_jax.evaluation.composite import score_composite, to_json
from getup_jax.evaluation.composite_rollout import make_player, policy_in, run_composite
from getup_jax.runtime import checkpoint
from getup_jax.runtime.pytree_store import CheckpointError
from getup_jax.training.run import build_composite_job

SCORES = "imitation_error.json"


def main(argv: Sequence[str] | None = None) -> int:
    """Evaluate, draw and print the last values; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("runs", nargs="+", metavar="NAME=RUN[,RUN ...]", help="run folders; NAME= may be left out")
    add("--out", type=Path, default=Path("imitation_error.png"), metavar="FILE")
    add("--episodes", type=int, default=16, metavar="N", help="of a checkpoint (default: 16)")
    add("--goals", action="store_true", help="a panel of each goal's reward too")
    args = parser.parse_args(argv)
    try:
        named = dict(split_name(text) for text in args.runs)
        scores = {
            name: [evaluated(folder, args.episodes) for folder in folders]
            for name, folders in named.items()
        }
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    panels = panels_of(scores, args.goals)
    draw(panels, args.out)
    for panel, curves in panels.items():
        for name, (steps, mean, spread) in curves.items():
            print(f"{panel}, {name}: {mean[-1]:.3f} +- {spread[-1]:.3f} at {steps[-1]:,.0f} steps")
    print(args.out)
    return 0


def split_name(text: str) -> tuple[str, list[Path]]:
    """The name and the run folders of an argument; ValueError where there are none."""
    name, equal, rest = text.rpartition("=")
    folders = [Path(part) for part in rest.split(",") if part]
    if not folders:
        raise ValueError(f"{text!r}: expected NAME=RUN[,RUN ...]")
    return (name if equal else folders[0].name), folders


def evaluated(
    folder: Path, number: int, play: Callable[[Path, list[Path], int], list] | None = None
) -> list[dict[str, Any]]:
    """Scores of a run's checkpoints, the oldest first; those in its file are not made anew."""
    file = folder / SCORES
    known = json.loads(file.read_text()) if file.is_file() else []
    known = [entry for entry in known if entry["episodes"] == number]
    done = {entry["checkpoint"] for entry in known}
    steps = checkpoint.steps(folder / checkpoint.CHECKPOINTS)
    if not steps and not known:
        raise CheckpointError(f"{folder}: no checkpoints; expected the folder of a run")
    fresh = [path for path in steps if path.name not in done]
    if fresh:
        known += (play or _play)(folder, fresh, number)
        known.sort(key=lambda entry: entry["steps"])
        file.write_text(json.dumps(known, indent=1) + "\n")
    return known


def _play(folder: Path, paths: list[Path], number: int) -> list[dict[str, Any]]:
    """The scores of checkpoints of one run, compiled once."""
    built, job = build_composite_job(checkpoint.load_policy(paths[-1]).config, lambda text: None)
    player = make_player(job, number)
    found = []
    for path in paths:
        loaded = checkpoint.load_policy(path)
        episodes = run_composite(job, policy_in(job, loaded), number, 0, player)
        scores = to_json(score_composite(built, episodes))
        entry = {"checkpoint": path.name, "steps": loaded.metadata["steps"], **scores}
        print(f"{folder} {path.name}: {entry['imitation_error_m']}", flush=True)
        found.append(entry)
    return found


def panels_of(
    scores: dict[str, list[list[dict[str, Any]]]], goals: bool
) -> dict[str, dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]]:
    """panel -> name -> (steps, mean, standard deviation over the name's runs)."""
    first = next(iter(scores.values()))[0][0]
    readers: dict[str, Callable[[dict], float]] = {}
    for group in first["imitation_error_m"]:
        for key, label in (("mean", f"{group}: error (m)"), ("travel", f"{group}: travel")):
            readers[label] = lambda entry, g=group, k=key: entry["imitation_error_m"][g][k]
    if goals:
        for goal in first["goals"]:
            readers[f"{goal}: reward"] = lambda entry, g=goal: entry["goals"][g]["reward"]
    return {
        label: {name: averaged(runs, read) for name, runs in scores.items()}
        for label, read in readers.items()
    }


def averaged(
    runs: list[list[dict[str, Any]]], read: Callable[[dict], float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean and standard deviation over runs, at the steps of the first that all have reached."""
    curves = [
        (np.array([e["steps"] for e in run], float), np.array([read(e) for e in run]))
        for run in runs
    ]
    begin = max(steps[0] for steps, _ in curves)
    end = min(steps[-1] for steps, _ in curves)
    grid = curves[0][0]
    grid = np.unique(np.concatenate([grid[(grid >= begin) & (grid <= end)], [begin, end]]))
    values = np.stack([np.interp(grid, steps, value) for steps, value in curves])
    return grid, values.mean(axis=0), values.std(axis=0)


def draw(
    panels: dict[str, dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]], file: Path
) -> None:
    """Write the picture."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(
        1, len(panels), figsize=(3.6 * len(panels), 3.2), squeeze=False, layout="constrained"
    )
    for axis, (panel, curves) in zip(axes[0], panels.items(), strict=True):
        for name, (steps, mean, spread) in curves.items():
            (line,) = axis.plot(steps / 1e6, mean, label=name)
            band = (mean - spread, mean + spread)
            axis.fill_between(steps / 1e6, *band, color=line.get_color(), alpha=0.25)
        axis.set(title=panel, xlabel="control steps (million)")
        if min(mean.min() for _, mean, _ in curves.values()) >= 0:
            axis.set_ylim(0.0, None)
        axis.grid(alpha=0.3)
    axes[0, 0].legend()
    figure.savefig(file, dpi=150)


if __name__ == "__main__":
    sys.exit(main())
