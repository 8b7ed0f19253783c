"""How good the pose prior of a config is, with and without its condition.

    python benchmarks/pose_prior.py [CONFIG] [section.key=value ...] [--no-standard] [--json FILE]
    python benchmarks/pose_prior.py --quick      only to see that it works

Trains (or takes from the cache) the conditional prior and the standard VAE of a config (default:
flat.yaml) and measures both on the poses that were held out, at most 2,000 of them. Rows:
held-out      reconstruction error of the held-out joint angles (degrees, root mean square)
features      errors of the features of random latents decoded under a held-out pose's condition
outside       share of random poses with a hinge more than 3 degrees past a limit, and the worst
penetration   share of random poses with a self-penetration of more than 2 cm, and the deepest;
              beside it the share of the held-out poses themselves
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from getup_jax.config import Config
from getup_jax.config.load import load_config
from getup_jax.core.resources import asset_path, cache_dir
from getup_jax.motion.library import load_motions
from getup_jax.physics.character import load_character
from getup_jax.pose_prior.cache import cached_prior
from getup_jax.pose_prior.data import make_pose_set, split
from getup_jax.pose_prior.report import PriorEvaluation, evaluate_prior
from getup_jax.pose_prior.training import PriorReport
from support.command import command

MOST = 2000  # poses in an evaluation
QUICK = ["prior.epochs=1", "prior.min_updates=1", "motion.augment_poses=256"]
Measured = tuple[PriorReport, PriorEvaluation]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*", metavar="CONFIG | section.key=value")
    parser.add_argument("--no-standard", action="store_true", help="only the config's own prior")
    parser.add_argument("--quick", action="store_true", help="few poses, one epoch: no quality")
    parser.add_argument("--json", type=Path)
    args = parser.parse_intermixed_args()
    overrides = [word for word in args.words if "=" in word] + (QUICK if args.quick else [])
    names = [word for word in args.words if "=" not in word] or ["flat"]
    config = load_config(names[0], overrides)
    results = measure(config, (True,) if args.no_standard else (True, False))
    Console().print(table(results))
    if args.json:
        plain = {
            name: {"report": dataclasses.asdict(report), "evaluation": dataclasses.asdict(found)}
            for name, (report, found) in results.items()
        }
        args.json.write_text(json.dumps(plain, indent=1) + "\n")


def measure(config: Config, kinds: tuple[bool, ...]) -> dict[str, Measured]:
    """{name: (training report, evaluation on held-out poses)} of each kind of prior."""
    character = load_character(config.physics)
    poses = load_motions(config.motion, character).poses
    data = make_pose_set(poses, character, mirrored=config.motion.mirror)
    results = {}
    for conditional in kinds:
        setting = dataclasses.replace(config.prior, conditional=conditional)
        folder, shipped = cache_dir() / "prior", asset_path("priors")
        prior, report = cached_prior(data, setting, folder, shipped=shipped)
        _, rows = split(data.group, setting.holdout, setting.seed)
        rows = rows[np.linspace(0, len(rows) - 1, min(MOST, len(rows))).astype(int)]
        name = "conditional" if conditional else "standard"
        results[name] = (report, evaluate_prior(prior, poses[rows], character))
    return results


def table(results: dict[str, Measured]) -> Table:
    """One column a prior."""
    rows = {
        "poses trained on / held out": lambda r, e: f"{r.num_poses} / {r.num_heldout}",
        "train error deg": lambda r, e: f"{r.train_rmse_deg:.2f}",
        "held-out error deg": lambda r, e: f"{r.heldout_rmse_deg:.2f}",
        "features m, rad, rad": lambda r, e: ", ".join(
            f"{value:.3f}" for value in dataclasses.astuple(e.random_feature_error)
        ),
        "random poses outside, worst deg": lambda r, e: (
            f"{e.random_poses_outside:.2%}, {e.random_worst_deg:.0f}"
        ),
        "random hinges outside": lambda r, e: f"{e.random_angles_outside:.3%}",
        "random penetration, deepest cm": lambda r, e: (
            f"{e.random_penetration.share_deep:.1%}, {100 * e.random_penetration.worst_m:.1f}"
        ),
        "held-out poses' penetration, deepest cm": lambda r, e: (
            f"{e.data_penetration.share_deep:.1%}, {100 * e.data_penetration.worst_m:.1f}"
        ),
    }
    found = Table(title="pose prior")
    found.add_column("")
    for name in results:
        found.add_column(name, justify="right")
    for name, text in rows.items():
        found.add_row(name, *(text(*result) for result in results.values()))
    return found


if __name__ == "__main__":
    command(main)
