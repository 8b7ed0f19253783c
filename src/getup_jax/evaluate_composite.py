"""`getup-eval` of a composite-motion policy: imitation error of every group, falls, a film."""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
import warnings
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax import video
from getup_jax.algo.meta import MetaTask
from getup_jax.checkpoint import LoadedPolicy
from getup_jax.config import ConfigError
from getup_jax.motion.clips import Clip
from getup_jax.motion.dtw import imitation_error
from getup_jax.progress import Display
from getup_jax.storage import from_nested
from getup_jax.tasks.build_composite import BuiltComposite, resampled
from getup_jax.tasks.groups import Group
from getup_jax.tasks.reference_windows import link_poses
from getup_jax.train import Job, build_composite_job

EPISODES = 32  # by default
_FILMED = 3


@dataclasses.dataclass(frozen=True, eq=False)
class CompositeEpisodes:
    """N episodes of T steps, played to their end whether the character fell or not."""

    position: np.ndarray  # [N, T, L, 3] of the links (m)
    quaternion: np.ndarray  # [N, T, L, 4]
    qpos: np.ndarray  # [N, T, 7 + J]
    fell: np.ndarray  # [N, T] bool, a fall or a failed simulation at this step
    goal_reward: np.ndarray  # [N, T, G] of the goal tasks
    goal_success: np.ndarray  # [N, G] share of the attempts that succeeded; NaN without attempts
    meta_weight: np.ndarray | None = None  # [N, T, A] w of equation 10; None: no meta policy


def evaluate_composite(args: argparse.Namespace, loaded: LoadedPolicy) -> int:
    """Run, score, print, and write what the arguments ask for; returns the exit code."""
    begin = time.monotonic()
    _refuse_getup_options(args)
    number = args.episodes or EPISODES
    with Display(number, unit="episodes") as display:
        task, job, policy = _restore(args, loaded, display)
        episodes = run_composite(job, policy, number, args.seed)
        scores = score_composite(task, episodes)
    print(_table(scores))
    print(f"{number} episodes in {time.monotonic() - begin:.0f} s")
    if args.json is not None:
        facts = {"path": str(loaded.path), "seed": loaded.config.seed, **loaded.metadata}
        args.json.write_text(json.dumps({**scores, "policy": facts}, indent=2) + "\n")
    if args.video is not None:
        _film(args.video, task, episodes)
        print(f"video: {args.video}")
    return 0


def run_composite(job: Job, policy: Any, number: int, seed: int) -> CompositeEpisodes:
    """Episodes from random starts with the mean action, and the mean one of a meta policy."""
    learner = job.learner
    env = learner.env
    if isinstance(env, MetaTask):
        env = dataclasses.replace(env, sample=False)
    task = env.task if isinstance(env, MetaTask) else env
    steps = round(task.config.episode_s / task.engine.control_dt)
    first = len(task.groups)

    def play(world: Any, policy: Any, key: jax.Array) -> tuple[jax.Array, ...]:
        state = env.init(world, key, number)

        def step(state: Any, _: None) -> tuple[Any, tuple[jax.Array, ...]]:
            observation = state.observation
            action = learner.act(policy, observation)
            state, output = env.advance(world, state, action)
            seen = env.kinematics(state)
            kept = (seen.link_position, seen.link_quaternion, seen.qpos, output.terminated)
            weight = learner.meta_weight(policy, observation)
            weight = jnp.zeros((number, 0)) if weight is None else weight
            return state, (*kept, output.reward[:, first:], weight)

        state, found = jax.lax.scan(step, state, None, length=steps)
        shares = list(env.success(state).values())
        success = jnp.stack(shares, axis=-1) if shares else jnp.zeros((number, 0))
        *found, weight = jax.tree.map(lambda x: jnp.swapaxes(x, 0, 1), found)
        return (*found, success, weight)

    found = jax.jit(play)(jax.device_put(job.world), policy, jax.random.PRNGKey(seed))
    *found, weight = (np.asarray(x) for x in found)
    return CompositeEpisodes(*found, meta_weight=weight if weight.size else None)


def score_composite(task: BuiltComposite, episodes: CompositeEpisodes) -> dict[str, Any]:
    """Imitation error (m) of every group, mean and std over episodes, and the share of falls."""
    rate = 1.0 / task.environment.engine.control_dt
    errors = {}
    for group in task.environment.groups:
        motion = _seen(group, episodes.position, episodes.quaternion)
        clips = [resampled(clip, rate) for clip in task.clips[group.name]]
        each = np.stack([_error(task, group, motion, clip) for clip in clips]).min(axis=0)
        errors[group.name] = {"mean": float(each.mean()), "std": float(each.std())}
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


def _meta_weights(task: BuiltComposite, episodes: CompositeEpisodes) -> dict[str, Any]:
    """Mean and std of the meta policy's weights over the hinges of every group [C figure 8]."""
    if episodes.meta_weight is None:
        return {}
    env, found = task.environment, {}
    for group in env.groups:
        own = episodes.meta_weight[..., np.isin(env.character.joint_link, group.links)]
        found[group.name] = {"mean": float(own.mean()), "std": float(own.std())}
    return found


def _error(task: BuiltComposite, group: Group, motion: np.ndarray, clip: Clip) -> np.ndarray:
    """Error [N] of a group's links [N, T, links, 3] against a clip that repeats."""
    position, quaternion = link_poses(clip.qpos[:-1], task.environment.character)
    reference = _seen(group, position[None], quaternion[None])[0]
    return imitation_error(motion, reference, loop=True)


def _seen(group: Group, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Positions [N, T, links, 3] in the group's frame of reference at each moment."""
    window = jax.jit(group.window)(position[:, :, None], quaternion[:, :, None])
    return np.asarray(group.positions(window))[:, :, 0]


def _restore(
    args: argparse.Namespace, loaded: LoadedPolicy, display: Display
) -> tuple[BuiltComposite, Job, Any]:
    config = dataclasses.replace(loaded.config, seed=args.seed)
    if args.engine is not None:
        physics = dataclasses.replace(config.physics, engine=args.engine, solver="auto")
        config = dataclasses.replace(config, physics=physics)
    display.log(f"{loaded.path}: {loaded.metadata.get('steps', 0):,} steps of training")
    task, job = build_composite_job(config, display.log)
    template = jax.eval_shape(job.learner.init_learner, jax.random.PRNGKey(0)).policy
    return task, job, from_nested(template, loaded.policy, str(loaded.path))


def _refuse_getup_options(args: argparse.Namespace) -> None:
    """Options that only mean something for getting up."""
    given = {
        "--plot": args.plot is not None,
        "--curves": bool(args.curves),
        "--blend": args.blend is not None,
        "--push": args.push is not None,
        "--start standing": args.start == "standing",
        "--terrain-seed": args.terrain_seed is not None,
    }
    wrong = [name for name, is_given in given.items() if is_given]
    if wrong:
        raise ConfigError(f"{', '.join(wrong)}: only for policies of the get-up task")


def _table(scores: dict[str, Any]) -> str:
    lines = ["group            imitation error (m)"]
    for name, error in scores["imitation_error_m"].items():
        lines.append(f"{name:16} {error['mean']:.3f} +- {error['std']:.3f}")
    for name, goal in scores["goals"].items():
        share = "-" if goal["success"] is None else f"{100 * goal['success']:.0f} %"
        lines.append(f"{name:16} reward {goal['reward']:.3f}, reached {share}")
    for name, weight in scores["meta_weight"].items():
        lines.append(f"{name:16} weight of the meta policy {weight['mean']:.2f}")
    lines.append(f"largest / smallest {scores['ratio']:.2f}")
    lines.append(f"episodes with a fall {100 * scores['fall_share']:.0f} %")
    return "\n".join(lines)


def _film(path: Path, task: BuiltComposite, episodes: CompositeEpisodes) -> None:
    """The first episodes one after the other."""
    imageio = video.require()
    env = task.environment
    with warnings.catch_warnings():
        # starting ffmpeg is a fork and an exec in one, which is safe
        warnings.filterwarnings("ignore", message="os.fork", category=RuntimeWarning)
        rate = round(1.0 / env.engine.control_dt)
        with imageio.get_writer(path, fps=rate, macro_block_size=8) as writer:
            for number, qpos in enumerate(episodes.qpos[:_FILMED], 1):
                names = " + ".join(
                    ", ".join(c.name for c in found) for found in task.clips.values()
                )
                for image in video.render(env.character.model, qpos):
                    writer.append_data(video.caption(image, f"{number}: {names}"))
