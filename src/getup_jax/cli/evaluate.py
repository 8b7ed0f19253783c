"""`getup-eval`: run a trained policy without noise, once an episode, and print its metrics."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from getup_jax.config import ConfigError
from getup_jax.evaluation import control_gain, plot
from getup_jax.evaluation import film as films
from getup_jax.evaluation.composite import evaluate_composite
from getup_jax.evaluation.getup import description, evaluate, evaluate_edits, evaluation_config
from getup_jax.evaluation.metrics import to_json
from getup_jax.evaluation.rollout import Episodes
from getup_jax.evaluation.scenario import Scenario
from getup_jax.evaluation.table import table
from getup_jax.runtime import checkpoint
from getup_jax.runtime.console import Display


def evaluate_command(args: argparse.Namespace) -> int:
    """The command line of `getup-eval`; returns the exit code."""
    begin = time.monotonic()
    if args.video is not None:
        films.require()
    if args.plot is not None:
        plot.require()
    loaded = checkpoint.load_policy(args.ckpt)
    if loaded.config.composite_motion:
        return evaluate_composite(args, loaded)
    if args.script is not None:
        raise ConfigError("--script: only for policies of composite motion")
    scenario = to_scenario(args)
    # a mistake is said before anything is built
    number = evaluation_config(loaded.config, scenario).task.pool_size
    with Display(number, unit="episodes") as display:
        display.log(f"{loaded.path}: {loaded.metadata.get('steps', 0):,} steps of training")
        episodes, scores = evaluate(loaded, scenario, display)
    control = evaluate_edits(loaded, episodes.task, scenario) if scenario.edits else None
    print(table(scores))
    if control is not None:
        print(control_gain.table({args.ckpt: control}))
    print(f"{number} episodes in {time.monotonic() - begin:.0f} s")
    if args.json is not None:
        facts = description(loaded, scenario, episodes)
        if control is not None:
            facts["control_gain"] = control_gain.to_json(control)
            facts["success_edits"] = control.success
        args.json.write_text(json.dumps({**to_json(scores), **facts}, indent=2) + "\n")
    _write_pictures(args.video, args.plot, episodes)
    return 0


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
        engine=args.engine,
    )


def _write_pictures(film: Path | None, picture: Path | None, episodes: Episodes) -> None:
    if picture is not None:
        plot.plot(picture, episodes)
        print(f"plot: {picture}")
    if film is not None:
        films.film(film, episodes)
        print(f"video: {film}")
