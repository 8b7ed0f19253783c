"""How well a policy obeys edits of its curves, and how well a search around it does.

    python benchmarks/style_control.py [POLICY] [--curves FILE ...] [--only STYLE ...] [--edits 8]
        [--bound N] [--seed 0] [--json FILE] [--quick]

POLICY: a run folder, a checkpoint or the name of a shipped policy (default: flat). Each of its
styles, or those of curve files, is followed as it is and with random edits of its inner control
points; what control_gain.py says about the measure holds. --bound N also measures a search
(trajectory_search/follow.py) on N edits of each style, which takes one to two minutes an episode on
two cores: choose few styles with --only.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from getup_jax.config import ConfigError
from getup_jax.envs.getup.build import build_task
from getup_jax.evaluation import control_gain
from getup_jax.evaluation.control_gain import ControlGain, edit_plan, measure
from getup_jax.evaluation.getup import Rate, chosen_styles, evaluation_config, restore_policy
from getup_jax.evaluation.options import natural, output, positive
from getup_jax.evaluation.scenario import Scenario
from getup_jax.motion.clips import GetUp
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.runtime import checkpoint
from getup_jax.runtime.console import Display
from getup_jax.trajectory_search.follow import bound
from support.command import command


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("policy", nargs="?", default="flat", metavar="POLICY")
    parser.add_argument("--curves", nargs="+", default=[], metavar="FILE")
    parser.add_argument("--only", nargs="+", default=[], metavar="STYLE")
    parser.add_argument("--edits", type=positive, default=8, metavar="N")
    parser.add_argument("--bound", type=positive, metavar="N")
    parser.add_argument("--seed", type=natural, default=0, metavar="S")
    parser.add_argument("--json", type=output(".json"), metavar="FILE")
    parser.add_argument("--quick", action="store_true", help="one edit of one style")
    args = parser.parse_args()
    results = run(args)
    print(control_gain.table(results))
    if args.json is not None:
        write(args.json, results)


def run(args: argparse.Namespace) -> dict[str, ControlGain]:
    """The measure of the policy and, where it is asked for, of the search."""
    scenario = Scenario(seed=args.seed, curves=tuple(map(str, args.curves or ())))
    loaded = checkpoint.load_policy(args.policy)
    config = evaluation_config(loaded.config, scenario)
    choose = chosen_styles(config, scenario)
    prior = pose_prior.from_checkpoint(loaded.prior)
    task = build_task(config, print, prior, choose)
    learner, policy = restore_policy(loaded, task)
    styles = numbers(args.only, task.getups)
    if args.quick:
        styles, args.edits = styles[:1], 1
    results = {}
    for name, how, edits in ((args.policy, measure, args.edits), ("search", bound, args.bound)):
        if edits is not None:
            plan = edit_plan(task, edits, args.seed, styles)
            with Display(len(plan.getup), unit="episodes") as display:
                rate = Rate(display, len(plan.getup))
                results[name] = how(task, learner, policy, plan, rate)
    return results


def numbers(names: Sequence[str], getups: Sequence[GetUp]) -> list[int]:
    """The numbers of the styles of those names; of all where none is named."""
    known = [getup.name for getup in getups]
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ConfigError(f"--only: expected styles of {', '.join(known)}, got {unknown[0]!r}")
    return [number for number, name in enumerate(known) if not names or name in names]


def write(file: Path, results: dict[str, ControlGain]) -> None:
    """{name: {control_gain, edits, curves}}."""
    plain = {
        name: {
            "control_gain": control_gain.to_json(result),
            "edits": result.edits,
            "curves": result.curves,
        }
        for name, result in results.items()
    }
    file.write_text(json.dumps(plain, indent=2) + "\n")


if __name__ == "__main__":
    command(main)
