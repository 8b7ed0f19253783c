"""`getup-eval`: run a trained policy without noise, once an episode, and print its metrics."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

from getup_jax.config import ConfigError
from getup_jax.core.output_file import write_text
from getup_jax.evaluation import driver, film, plot, steering
from getup_jax.evaluation.scenario import Scenario
from getup_jax.evaluation.steering_script import read_script
from getup_jax.motion.io.glb_writer import require_glb
from getup_jax.motion.io.usd_writer import require_usd
from getup_jax.runtime import checkpoint
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.console import Display


def evaluate_command(args: argparse.Namespace) -> int:
    """The command line of `getup-eval`; returns the exit code."""
    begin = time.monotonic()
    if args.video is not None:
        film.require()
    if args.turntable is not None:
        film.require("--turntable")
    if args.plot is not None:
        plot.require()
    if args.glb is not None:
        require_glb()
    if args.usd is not None:
        require_usd()
    loaded, scenario = checkpoint.load_policy(args.ckpt), to_scenario(args)
    if args.script is not None:
        return _steer(args, loaded, scenario)
    # a mistake is said before anything is built
    number = driver.episode_count(loaded, scenario, plotted=args.plot is not None)
    with Display(number, unit="episodes") as display:
        found = driver.evaluate(loaded, scenario, display)
    print(found.table)
    print(f"{number} episodes in {time.monotonic() - begin:.0f} s")
    _write(args.json, found.facts)
    if args.plot is not None:
        found.plot(args.plot)
        print(f"plot: {args.plot}")
    if args.video is not None:
        found.film(args.video, args.size)
        print(f"video: {args.video}")
    if args.turntable is not None:
        found.turntable(args.turntable)
        print(f"turntable: {args.turntable}")
    for kind, path in (("glb", args.glb), ("usd", args.usd)):
        if path is not None:
            found.takes(path)
            print(f"{kind}: {path}")
    return 0


def _steer(args: argparse.Namespace, loaded: LoadedPolicy, scenario: Scenario) -> int:
    """One character that is steered by a script."""
    if not loaded.config.composite_motion:
        raise ConfigError("--script: only for policies of composite motion")
    scenario.check_composite()
    if args.plot is not None:
        raise ConfigError("--plot: not with --script; run getup-eval once more without it")
    for option in ("glb", "usd", "turntable"):
        if getattr(args, option) is not None:
            raise ConfigError(f"--{option}: not with --script; run getup-eval once more without it")
    course, task = steering.steer(loaded, scenario, read_script(args.script))
    print(steering.table(course))
    _write(args.json, steering.to_json(course))
    if args.video is not None:
        steering.film(args.video, task, course, args.size)
        print(f"video: {args.video}")
    return 0


def _write(path: Path | None, facts: dict[str, Any]) -> None:
    if path is not None:
        write_text(path, json.dumps(facts, indent=2) + "\n")


def to_scenario(args: argparse.Namespace) -> Scenario:
    """What `getup-eval` was asked for."""
    return Scenario(
        episodes=args.episodes,
        start=args.start,
        start_noise_rad=args.start_noise,
        duration_scale=args.duration_scale,
        blend=args.blend,
        push_ns=args.push,
        edits=args.edits or 0,
        seed=args.seed,
        curves=tuple(map(str, args.curves or ())),
        motions=None if args.motions is None else str(args.motions),
        drops=args.drops,
        stand_time_s=args.stand_time,
        terrain_seed=args.terrain_seed,
        ground=args.ground,
        engine=args.engine,
    )
