"""`getup-eval`: run a trained policy without noise, once an episode, and score it."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from getup_jax import checkpoint
from getup_jax.algo.learner import Learner, make_learner
from getup_jax.config import Config
from getup_jax.nets import prior as pose_prior
from getup_jax.scores import score, table, to_json
from getup_jax.storage import from_nested
from getup_jax.tasks.build import BuiltTask, build_task
from getup_jax.tasks.episode import LYING, STANDING, EpisodeState

BATCH = 256  # episodes simulated at once
Log = Callable[[str], None]


@struct.dataclass
class Trace:
    """What happened in B episodes, step by step; leaves [T, B, ...]."""

    features: jax.Array  # [T, B, 3] height (m), side and front angle (rad)
    target: jax.Array  # [T, B, 3] the curves at the same time
    time: jax.Array  # [T, B] s since the curve's start
    qpos: jax.Array  # [T, B, 7 + J]
    qvel: jax.Array  # [T, B, 6 + J]
    torque: jax.Array  # [T, B, J] Nm
    task_reward: jax.Array  # [T, B]
    running: jax.Array  # [T, B] bool, the step belongs to the episode
    success: jax.Array  # [T, B] bool, the episode ended here, standing
    duration: jax.Array  # [T, B] s, T of the curve


def evaluate_command(args: argparse.Namespace) -> int:
    """The command line of `getup-eval`; returns the exit code."""
    begin = time.monotonic()
    loaded = checkpoint.load_policy(args.ckpt)
    config = evaluation_config(loaded.config, args)
    print(f"{loaded.path}: {loaded.metadata.get('steps', 0):,} steps of training", flush=True)
    task = build_task(config, _say, pose_prior.from_dict(loaded.prior))
    learner = _learner(config, task)
    template = jax.eval_shape(learner.init_learner, jax.random.PRNGKey(0)).policy
    policy = from_nested(template, loaded.policy, str(loaded.path))
    kind = STANDING if args.start == "standing" else LYING
    trace, getup = run_episodes(task, learner, policy, args.episodes, args.seed, kind, _say)
    env = task.environment
    scores = score(trace, getup, task.getups, env.engine.control_dt, config.task.stand_time_s)
    print(table(scores))
    print(f"{args.episodes} episodes in {time.monotonic() - begin:.0f} s")
    if args.json is not None:
        args.json.write_text(json.dumps(to_json(scores), indent=2) + "\n")
    if args.video is not None:
        from getup_jax.video import film

        film(args.video, env.character.model, trace, getup, task.getups)
        print(f"video: {args.video}")
    return 0


def evaluation_config(config: Config, args: argparse.Namespace) -> Config:
    """The training config with one kind of start only, as many as there are episodes."""
    physics, task = config.physics, config.task
    if args.engine is not None:
        solver = "auto" if physics.solver == "pgs" else physics.solver  # MJX has no PGS
        physics = dataclasses.replace(physics, engine=args.engine, solver=solver)
    stand_time_s = task.stand_time_s if args.stand_time is None else args.stand_time
    task = dataclasses.replace(
        task,
        stand_start=float(args.start == "standing"),
        clip_start=0.0,
        pool_size=args.episodes,
        stand_time_s=stand_time_s,
    )
    return dataclasses.replace(config, physics=physics, task=task, seed=args.seed)


def run_episodes(
    task: BuiltTask,
    learner: Learner,
    policy: Any,
    episodes: int,
    seed: int,
    kind: int,
    log: Log,
) -> tuple[Trace, np.ndarray]:
    """One start of the given kind each: the styles in turn, the rows of the pool by the seed.

    Returns the trace, leaves [T, N, ...] as NumPy arrays, and the style [N] of every episode.
    """
    _, num_styles, rows = task.world.pool.table.shape
    getup = np.arange(episodes) % num_styles
    row = np.random.default_rng(seed).integers(rows, size=episodes)
    size = min(BATCH, episodes)
    options = task.environment.engine.compiler_options
    roll = jax.jit(_roll, static_argnums=(0, 1, 2, 3), compiler_options=options)
    length = episode_steps(task, kind)
    parts = []
    for first in range(0, episodes, size):
        # the last batch is filled up, so that one program serves all of them
        index = np.minimum(np.arange(first, first + size), episodes - 1)
        part = roll(
            task.environment, learner, length, kind, task.world, policy, getup[index], row[index]
        )
        keep = min(size, episodes - first)
        parts.append(jax.tree.map(lambda x, keep=keep: np.asarray(x)[:, :keep], part))
        log(f"{min(first + size, episodes)} of {episodes} episodes")
    return jax.tree.map(lambda *x: np.concatenate(x, axis=1), *parts), getup


def episode_steps(task: BuiltTask, kind: int) -> int:
    """Control steps of the longest episode."""
    rise = float(np.max(np.asarray(task.world.duration))) if kind == LYING else 0.0
    total = rise + task.environment.config.stand_time_s
    return math.ceil(total / task.environment.engine.control_dt)


def _roll(
    env: Any,
    learner: Learner,
    length: int,
    kind: int,
    world: Any,
    policy: Any,
    getup: Any,
    row: Any,
) -> Trace:
    kinds = jnp.full(len(getup), kind, jnp.int32)
    state = env.start(world, jnp.asarray(getup, jnp.int32), kinds, jnp.asarray(row))
    verdict = "stand_success" if kind == STANDING else "success"

    def step(carry: tuple[EpisodeState, jax.Array], _: None) -> tuple[Any, Trace]:
        state, running = carry
        state, output = env.advance(world, state, learner.act(policy, state.observation))
        kinematics = state.physics.kinematics
        trace = Trace(
            features=env.observer.posture(kinematics, world.terrain).features,
            target=env.targets(world, state)[:, 0],
            time=state.time,
            qpos=kinematics.qpos,
            qvel=kinematics.qvel,
            torque=kinematics.torque,
            task_reward=output.metrics["reward_task"],
            running=running,
            success=running & (output.episode[verdict] == 1.0),
            duration=state.duration,
        )
        return (state, running & ~(output.terminated | output.truncated)), trace

    _, trace = jax.lax.scan(step, (state, jnp.ones(len(getup), bool)), None, length=length)
    return trace


def _learner(config: Config, task: BuiltTask) -> Learner:
    return make_learner(
        task.environment, config.network, config.ppo, total_steps=config.train.total_steps
    )


def _say(text: str) -> None:
    print(text, flush=True)
