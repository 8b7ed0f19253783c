"""`getup-search`: find ways up by sampling, and write them into a folder."""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from getup_jax.config import Config, ConfigError
from getup_jax.config.load import load_config
from getup_jax.config.task import OWN_POSES
from getup_jax.envs.getup.build import build_task
from getup_jax.envs.getup.resets.archived_states import load_path, path_file, save_path
from getup_jax.runtime.console import Display
from getup_jax.trajectory_search.finder import POPULATION, ROUNDS, Finder

START_NOISE_RAD = 0.05  # joint noise of the lying starts

_EXAMPLES = """\
examples:
  getup-search flat --out runs/paths                   all styles of configs/flat.yaml
  getup-search flat --out runs/paths --only supine     those whose names start with `supine`
  getup-train flat curriculum.archive=runs/paths               train with starts at the states found

A style is searched with other settings until a search ends standing. What an earlier command found
is not searched again.
"""


def parser() -> argparse.ArgumentParser:
    """The command's options."""
    made = argparse.ArgumentParser(
        prog="getup-search",
        description="Find physically possible ways up from the floor by sampling.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = made.add_argument
    add("config", metavar="CONFIG", help="a YAML file, or the name of a shipped one such as flat")
    add("overrides", metavar="key=value", nargs="*", help="settings that replace the file's")
    add("--out", type=Path, required=True, metavar="FOLDER", help="gets a file for every search")
    add("--only", nargs="+", default=[""], metavar="NAME", help="styles whose names start so")
    add("--rounds", type=int, default=len(ROUNDS), help="searches of a style at most (default: 3)")
    add("--children", type=int, default=2048, help="simulations that sample (default: 2048)")
    add("--seed", type=int, default=0)
    return made


def search_command(args: argparse.Namespace) -> int:
    """Run the command; returns the exit code."""
    if not 1 <= args.rounds <= len(ROUNDS):
        raise ConfigError(f"--rounds: expected 1 to {len(ROUNDS)}, got {args.rounds}")
    if args.children < 2 * POPULATION or args.children % POPULATION:
        multiple = f"a multiple of {POPULATION} of at least {2 * POPULATION}"
        raise ConfigError(f"--children: expected {multiple}, got {args.children}")
    config = search_config(load_config(args.config, args.overrides), args.seed)
    with Display(1, unit="searches") as display:
        task = build_task(config, display.log)
    wanted = [i for i, g in enumerate(task.getups) if g.name.startswith(tuple(args.only))]
    if not wanted:
        names = ", ".join(getup.name for getup in task.getups)
        raise ConfigError(f"--only {' '.join(args.only)}: expected the start of one of {names}")
    finder = Finder(task, children=args.children)
    with Display(len(wanted) * args.rounds, unit="searches") as display:
        display.start(0)
        begin = time.monotonic()
        for done, report in enumerate(_searches(finder, wanted, args)):
            display.log(report)
            display.update(done + 1, (done + 1) / (time.monotonic() - begin), {})
    return 0


def search_config(config: Config, seed: int) -> Config:
    """The training config with lying starts only, all of them a little different."""
    if config.terrain is not None:
        raise ConfigError("terrain: expected null; ways up are searched on flat ground")
    task = dataclasses.replace(
        config.task, stand_start=0.0, start_noise_rad=START_NOISE_RAD, **OWN_POSES
    )
    return dataclasses.replace(config, task=task, curriculum=None, seed=seed)


def _searches(finder: Finder, wanted: Sequence[int], args: argparse.Namespace) -> Iterator[str]:
    """Search, save, and report on one search at a time; rounds that are not needed report it."""
    stands: set[int] = set()
    for number, settings in enumerate(ROUNDS[: args.rounds]):
        for style in wanted:
            getup, seed = finder.task.getups[style], args.seed * len(ROUNDS) + number
            if style in stands:
                yield f"{getup.name}: has a way to standing"
                continue
            file = path_file(args.out, getup, seed)
            path = load_path(file) if file.exists() else finder.find(style, settings, seed)
            if path is None:
                yield f"{getup.name}: no motion to search along"
                continue
            if not file.exists():
                save_path(args.out, getup, path)
            if path.finished:
                stands.add(style)
            share = path.time.max(initial=0.0) / getup.duration
            end = "stands" if path.finished else f"follows the curve to {share:.0%} of its time"
            yield f"{getup.name}: {len(path.time)} states, {end}"
