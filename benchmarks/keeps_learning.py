"""Does training on keep what a policy can do? A guard over the learner.

    python benchmarks/keeps_learning.py flat [--steps 5e6] [--run FOLDER] [--quick] [key=value ...]
    python benchmarks/keeps_learning.py terrain walk --steps 1e6 --json out.json

Every named policy is evaluated as it is shipped, trained on without help for some steps, and
evaluated again from the same starts, without noise. Printed is the difference of every measure,
episode by episode, with its 95 % interval: a learner that unlearns has one that is below 0. A run
that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from getup_jax.config.load import load_config
from getup_jax.evaluation import getup
from getup_jax.evaluation.composite import imitation_errors
from getup_jax.evaluation.composite_rollout import restore, run_composite
from getup_jax.evaluation.metrics import episode_values
from getup_jax.evaluation.scenario import Scenario
from getup_jax.runtime import checkpoint
from getup_jax.runtime.console import Display
from getup_jax.training.run import run

# the networks of the shipped policies, no help, and the noise of a run's end
_GETUP = (
    "network.mirror=false",
    "prior.mirror=false",
    "curriculum.assistive_wrench=0",
    "curriculum.reference_start=0.2",
    "curriculum.prioritisation=0",
    "curriculum.short_share=0",
    "ppo.action_std=[0.2,0.2]",
)
_QUICK = ("ppo.num_envs=16", "ppo.num_steps=8", "ppo.minibatch_size=128")
Values = dict[str, np.ndarray]  # measure -> [N], one number an episode, larger is better


@dataclasses.dataclass(frozen=True)
class Case:
    """A shipped policy, and how it is trained on."""

    config: str
    settings: tuple[str, ...]
    episodes: int


CASES = {
    "flat": Case("flat", _GETUP, 280),
    "terrain": Case("terrain", (*_GETUP, "terrain.curriculum=none"), 400),
    "walk": Case("composite_walk_location", ("composite.warm_start=false",), 64),
}


def main() -> None:
    """Train and compare the policies of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    # pairs of key=value are told from names by their "="
    parser.add_argument("words", nargs="*", metavar="POLICY | key=value")
    parser.add_argument("--steps", type=float, default=5e6, help="of training (default: 5e6)")
    parser.add_argument("--episodes", type=int, help="of an evaluation (default: 64 to 400)")
    parser.add_argument("--run", type=Path, default=Path("runs/keeps_learning"), metavar="FOLDER")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--quick", action="store_true", help="the first policy, one iteration")
    args = parser.parse_intermixed_args()
    settings = [word for word in args.words if "=" in word]
    names = [word for word in args.words if "=" not in word] or list(CASES)
    unknown = [name for name in names if name not in CASES]
    if unknown:
        parser.error(f"{', '.join(unknown)}: expected one of {', '.join(CASES)}")
    found = {}
    with tempfile.TemporaryDirectory() as scratch:
        if args.quick:  # never in the folder of a run that is to go on
            names, settings = names[:1], [*_QUICK, *settings]
            args.steps, args.episodes, args.run = 1, args.episodes or 4, Path(scratch)
        for name in names:
            case = CASES[name]
            number = args.episodes or case.episodes
            found[name] = guard(name, case, settings, int(args.steps), number, args.run / name)
            print(table(name, found[name]))
    if args.json is not None:
        args.json.write_text(json.dumps(found, indent=2) + "\n")


def guard(
    name: str, case: Case, settings: list[str], steps: int, episodes: int, folder: Path
) -> dict[str, Any]:
    """Train the policy on in the folder, and compare it with what it was."""
    overrides = [*case.settings, f"train.init_from={name}", f"train.total_steps={steps}"]
    config = load_config(case.config, [*overrides, *settings])
    if run(config, folder, resume=True) is not None:
        raise SystemExit(f"{name}: stopped; the same command goes on")
    measure = composite_values if config.composite_motion else getup_values
    before, after = measure(name, episodes), measure(str(folder), episodes)
    return compare(before, after)


def getup_values(path: str, episodes: int) -> Values:
    """Return rate, success and errors of a get-up policy's episodes."""
    loaded = checkpoint.load_policy(path)
    with Display(episodes, unit="episodes") as display:
        played, _ = getup.evaluate(loaded, Scenario(episodes=episodes), display)
    env = played.task.environment
    values = episode_values(played.trace, env.engine.control_dt, env.config.stand_time_s)
    losses = {name: -values[name] for name in ("height_error_m", "angle_error_rad", "jitter")}
    return {name: values[name] for name in ("return_rate", "success")} | losses


def composite_values(path: str, episodes: int) -> Values:
    """Imitation errors, goals reached and falls of a composite policy's episodes."""
    loaded = checkpoint.load_policy(path)
    found = restore(loaded.config, loaded, print)
    played = run_composite(found.job, found.policy, episodes, seed=0)
    values = {f"dtw_m_{k}": -x for k, x in imitation_errors(found.built, played).items()}
    names = found.built.environment.goals.names
    values |= {f"success_{name}": played.goal_success[:, k] for k, name in enumerate(names)}
    return values | {"upright": 1.0 - played.fell.any(axis=1)}


def compare(before: Values, after: Values) -> dict[str, dict[str, float]]:
    """Means before and after, and the mean difference of pairs with its 95 % interval."""
    return {name: _paired(before[name], after[name]) for name in before}


def _paired(before: np.ndarray, after: np.ndarray) -> dict[str, float]:
    known = np.isfinite(before) & np.isfinite(after)
    difference = (after - before)[known]
    half = 1.96 * float(difference.std(ddof=1)) / math.sqrt(len(difference))
    return {
        "before": float(before[known].mean()),
        "after": float(after[known].mean()),
        "difference": float(difference.mean()),
        "interval": half,
        "episodes": len(difference),
    }


def table(name: str, found: dict[str, dict[str, float]]) -> str:
    """One line a measure; errors count as negative, so that more is better in all of them."""
    lines = [f"{name:24} before    after     difference (95 %)"]
    for measure, row in found.items():
        mark = "  WORSE" if row["difference"] + row["interval"] < 0 else ""
        spread = f"{row['difference']:+.4f} +- {row['interval']:.4f}"
        lines.append(f"  {measure:22} {row['before']:8.4f}  {row['after']:8.4f}  {spread}{mark}")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
