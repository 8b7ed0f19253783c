"""`getup-eval` of a composite-motion policy: imitation error of every group, falls, a film."""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
from typing import Any

import jax
import numpy as np

from getup_jax.config import Config, ConfigError
from getup_jax.envs.composite.build import BuiltComposite
from getup_jax.envs.composite.groups import Group
from getup_jax.envs.composite.reference_state_init import resampled
from getup_jax.envs.composite.reference_windows import link_poses
from getup_jax.evaluation import meta_weights_plot
from getup_jax.evaluation.composite_film import film
from getup_jax.evaluation.composite_rollout import CompositeEpisodes, restore, run_composite
from getup_jax.evaluation.steering import steer_command
from getup_jax.evaluation.steering_script import read_script
from getup_jax.motion.clips import Clip
from getup_jax.motion.dtw import imitation_error
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.console import Display

EPISODES = 32  # by default


def evaluate_composite(args: argparse.Namespace, loaded: LoadedPolicy) -> int:
    """Run, score, print, and write what the arguments ask for; returns the exit code."""
    begin = time.monotonic()
    _refuse_getup_options(args)
    config = evaluation_config(args, loaded.config)
    if args.plot is not None:
        assert config.composite is not None
        meta_weights_plot.check(config.composite)
    if args.script is not None:
        return steer_command(args, loaded, config, read_script(args.script))
    number = args.episodes or EPISODES
    with Display(number, unit="episodes") as display:
        display.log(f"{loaded.path}: {loaded.metadata.get('steps', 0):,} steps of training")
        found = restore(config, loaded, display.log)
        episodes = run_composite(found.job, found.policy, number, args.seed)
        scores = score_composite(found.built, episodes)
    print(_table(scores))
    print(f"{number} episodes in {time.monotonic() - begin:.0f} s")
    if args.json is not None:
        facts = {"path": str(loaded.path), "seed": loaded.config.seed, **loaded.metadata}
        args.json.write_text(json.dumps({**scores, "policy": facts}, indent=2) + "\n")
    if args.plot is not None:
        meta_weights_plot.plot_weights(args.plot, found.built.environment.character, episodes)
        print(f"plot: {args.plot}")
    if args.video is not None:
        film(args.video, found.built, episodes)
        print(f"video: {args.video}")
    return 0


def score_composite(task: BuiltComposite, episodes: CompositeEpisodes) -> dict[str, Any]:
    """Imitation error (m) of every group, mean and std over episodes, and the share of falls.

    `travel` is how far the group's links move, as a share of what they do in the clips: a
    character that stands still in a typical pose has a small error too, where the clips move
    little.
    """
    errors = {}
    for group in task.environment.groups:
        motion, references = _compared(task, group, episodes)
        each = group_errors(motion, references)
        errors[group.name] = {"mean": float(each.mean()), "std": float(each.std())}
        own = np.mean([_speed(reference) for reference in references])
        errors[group.name]["travel"] = float(_speed(motion) / max(own, 1e-9))
    means = [error["mean"] for error in errors.values()]
    goals = {}
    for index, name in enumerate(task.environment.goals.names):
        share = episodes.goal_success[:, index]
        known = share[np.isfinite(share)]
        goals[name] = {
            "reward": float(episodes.goal_reward[:, :, index].mean()),
            "success": float(known.mean()) if known.size else None,
        }
    return {
        "goals": goals,
        "meta_weight": _meta_weights(task, episodes),
        "imitation_error_m": errors,
        "ratio": max(means) / max(min(means), 1e-9),
        "fall_share": float(episodes.fell.any(axis=1).mean()),
        "episodes": len(episodes.fell),
    }


def imitation_errors(task: BuiltComposite, episodes: CompositeEpisodes) -> dict[str, np.ndarray]:
    """Imitation error [N] (m) of every episode, by group."""
    groups = task.environment.groups
    return {g.name: group_errors(*_compared(task, g, episodes)) for g in groups}


def group_errors(motion: np.ndarray, references: list[np.ndarray]) -> np.ndarray:
    """Error [N] (m) of motions [N, T, links, 3] to the nearest of the references [S, links, 3]."""
    found = [imitation_error(motion, reference, loop=True) for reference in references]
    return np.stack(found).min(axis=0)


def _compared(
    task: BuiltComposite, group: Group, episodes: CompositeEpisodes
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Positions [N, T, links, 3] of a group's links in the episodes, and those of its clips."""
    motion = _seen(group, episodes.position, episodes.quaternion)
    rate = 1.0 / task.environment.engine.control_dt
    clips = [resampled(clip, rate) for clip in task.clips[group.name]]
    return motion, [_reference(task, group, clip) for clip in clips]


def _meta_weights(task: BuiltComposite, episodes: CompositeEpisodes) -> dict[str, Any]:
    """Mean and std of the meta policy's weights over the hinges of every group [C figure 8]."""
    if episodes.meta_weight is None:
        return {}
    env, found = task.environment, {}
    for group in env.groups:
        own = episodes.meta_weight[..., np.isin(env.character.joint_link, group.links)]
        found[group.name] = {"mean": float(own.mean()), "std": float(own.std())}
    return found


def _reference(task: BuiltComposite, group: Group, clip: Clip) -> np.ndarray:
    """Positions [S, links, 3] of a group's links in a clip that repeats."""
    position, quaternion = link_poses(clip.qpos[:-1], task.environment.character)
    return _seen(group, position[None], quaternion[None])[0]


def _speed(position: np.ndarray) -> float:
    """Mean way (m) of the links [..., T, links, 3] from frame to frame."""
    return float(np.linalg.norm(np.diff(position, axis=-3), axis=-1).mean())


def _seen(group: Group, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Positions [N, T, links, 3] in the group's frame of reference at each moment."""
    window = jax.jit(group.window)(position[:, :, None], quaternion[:, :, None])
    return np.asarray(group.positions(window))[:, :, 0]


def evaluation_config(args: argparse.Namespace, config: Config) -> Config:
    """The training config with the seed and the engine of the arguments."""
    config = dataclasses.replace(config, seed=args.seed)
    if args.engine is not None:
        physics = dataclasses.replace(config.physics, engine=args.engine, solver="auto")
        config = dataclasses.replace(config, physics=physics)
    return config


def _refuse_getup_options(args: argparse.Namespace) -> None:
    """Options that only mean something for getting up."""
    given = {
        "--curves": bool(args.curves),
        "--blend": args.blend is not None,
        "--push": args.push is not None,
        "--drops": args.drops is not None,
        "--edits": args.edits is not None,
        "--start standing": args.start == "standing",
        "--terrain-seed": args.terrain_seed is not None,
    }
    if args.script is not None and args.plot is not None:
        raise ConfigError("--plot: not with --script; run getup-eval once more without it")
    wrong = [name for name, is_given in given.items() if is_given]
    if wrong:
        raise ConfigError(f"{', '.join(wrong)}: only for policies of the get-up task")


def _table(scores: dict[str, Any]) -> str:
    lines = ["group            imitation error (m)   travel (share of the clips')"]
    for name, error in scores["imitation_error_m"].items():
        spread = f"{error['mean']:.3f} +- {error['std']:.3f}"
        lines.append(f"{name:16} {spread:21} {error['travel']:.2f}")
    for name, goal in scores["goals"].items():
        share = "-" if goal["success"] is None else f"{100 * goal['success']:.0f} %"
        lines.append(f"{name:16} reward {goal['reward']:.3f}, reached {share}")
    for name, weight in scores["meta_weight"].items():
        lines.append(f"{name:16} weight of the meta policy {weight['mean']:.2f}")
    lines.append(f"largest / smallest {scores['ratio']:.2f}")
    lines.append(f"episodes with a fall {100 * scores['fall_share']:.0f} %")
    return "\n".join(lines)
