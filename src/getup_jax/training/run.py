"""One training run, from the settings to the last checkpoint."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np

from getup_jax.config import Config
from getup_jax.config.check import require
from getup_jax.envs.composite.build import BuiltComposite, build_composite
from getup_jax.envs.composite.discriminator_rewards import make_discriminator_rewards
from getup_jax.envs.composite.goals import equipment_of
from getup_jax.envs.composite.meta.chain import with_meta
from getup_jax.envs.composite.meta.meta_policy import MetaTask
from getup_jax.envs.getup.build import build_task
from getup_jax.envs.getup.episode import with_shared
from getup_jax.envs.getup.task import World
from getup_jax.imitation import action_distillation
from getup_jax.imitation.dagger import Setup, warm_start
from getup_jax.imitation.irregular_distillation import distill_on_irregular
from getup_jax.imitation.slope_warm_start import warm_start_on_slopes
from getup_jax.physics.body_digest import body_digest, warn_if_other
from getup_jax.physics.character import load_character
from getup_jax.rl.learner import Learner, make_learner
from getup_jax.rl.state import PolicyState
from getup_jax.runtime import checkpoint, processes
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.console import Display, count, duration
from getup_jax.runtime.metric_file import MetricsWriter, NoMetrics, tensorboard_module
from getup_jax.runtime.run_folder import prepare, resume_command
from getup_jax.runtime.signals import StopRequest
from getup_jax.runtime.wandb_log import WandbLog
from getup_jax.training.loop import (
    CarryOver,
    Job,
    Loop,
    TrainingError,
    num_iterations,
    steps_per_iteration,
)
from getup_jax.training.spread import check_divides, check_shared, described

__all__ = ["Job", "TrainingError", "build_job", "run"]

Log = Callable[[str], None]


def build_job(config: Config, log: Log) -> Job:
    """The task and the learner that the settings ask for."""
    if config.composite_motion:
        return build_composite_job(config, log)[1]
    task = build_task(config, log)
    learner = make_learner(
        task.environment,
        config.network,
        config.ppo,
        total_steps=config.train.total_steps,
        weights=tuple(task.environment.objective_weights.values()),
        discounts=task.environment.discounts(config.ppo.discount),
    )
    carry_over = _carry_over(learner, task.world, config)
    body = body_digest(task.environment.character.model)
    return Job(learner, task.world, task.prior, carry_over, share=with_shared, body=body)


def _carry_over(learner: Learner, world: World, config: Config) -> CarryOver:
    def carry_over(policy: PolicyState, loaded: LoadedPolicy, log: Log) -> PolicyState:
        teacher = action_distillation.make_teacher(config, learner, world, loaded, policy)
        key, key_ground = jax.random.split(jax.random.PRNGKey(config.seed))
        policy = action_distillation.carry_over(learner, world, policy, teacher, key, log)
        on_plane = learner.env.terrain is None or loaded.config.terrain is not None
        if config.train.irregular_from is not None:
            other = _knows_irregular_ground(config, loaded)
            where = "train.irregular_from"
            teacher = action_distillation.make_teacher(config, learner, world, other, policy, where)
            return distill_on_irregular(learner, world, policy, teacher, key_ground, log)
        if world.prior is None or on_plane:
            return policy
        return warm_start_on_slopes(learner, world, policy, key_ground, log)

    return carry_over


def build_composite_job(config: Config, log: Log) -> tuple[BuiltComposite, Job]:
    """The task, and the learner and the world of composite motion."""
    built = build_composite(config, log)
    env, world, composite = built.environment, built.world, built.environment.config
    if composite.meta is not None:
        log(f"meta policy: {composite.meta}")
        env, world = with_meta(config, built)
    learner = make_learner(
        env,
        config.network,
        config.ppo,
        total_steps=config.train.total_steps,
        reward_model=make_discriminator_rewards(built.environment, composite),
    )
    prepare = None
    if composite.warm_start:
        prepare = functools.partial(_warm_start, learner, built, world, config.seed)
    body = body_digest(built.environment.character.model)
    return built, Job(learner=learner, world=world, prior=None, prepare=prepare, body=body)


def _warm_start(
    learner: Learner, built: BuiltComposite, world: Any, seed: int, policy: PolicyState, log: Log
) -> PolicyState:
    env = learner.env
    new = np.array(env.new) if isinstance(env, MetaTask) else None
    return warm_start(learner, Setup(built, world, new), policy, jax.random.PRNGKey(seed), log)


def run(
    config: Config,
    run_folder: str | Path,
    resume: bool = False,
    quiet: bool = False,
    build: Callable[[Config, Log], Job] = build_job,
) -> int | None:
    """Train until `train.total_steps`, or until Ctrl-C, SIGTERM or SIGHUP.

    Args:
        config: the settings; written into the folder.
        run_folder: gets config.yaml, metrics.jsonl and checkpoints/.
        resume: go on from the folder's newest checkpoint, where it has one.
        quiet: print nothing.
        build: makes the task and the learner.

    It runs on every device of every process that `processes.join` has brought together, all of
    which call this.

    Returns:
        None at the end of the run, else the number of the signal that stopped it.

    Raises RunError, CheckpointError and TrainingError with texts for the user.
    """
    folder = Path(run_folder)
    total = num_iterations(config) * steps_per_iteration(config)
    quiet = quiet or not processes.is_first()
    check_divides(config, jax.device_count())
    with (
        processes.lost_is_an_error(),
        Display(total, quiet) as display,
        StopRequest(display.log) as stop,
        contextlib.ExitStack() as held,
    ):
        processes.first_alone(
            lambda: held.enter_context(prepare(folder, config, resume, display.log))
        )
        check_shared(config, folder)
        if _finished(folder, config):
            display.log(f"{folder} has all of its {count(total)} steps; raise train.total_steps")
            return None
        # what is wrong is said now rather than after minutes of compiling
        if config.train.tensorboard:
            tensorboard_module()
        fresh = not checkpoint.steps(folder / checkpoint.CHECKPOINTS)
        start = _policy_to_begin_with(config, display.log) if fresh else None
        wandb = _wandb(folder, config)
        begin = time.monotonic()
        display.log(f"building the task ({described()}) ...")
        loop = Loop(config, folder, build(config, display.log), display, start)
        with _writer(folder, loop, config, wandb) as writer, stop.armed():
            loop.train(writer, stop)
        display.close()
        display.log(_closing(folder, loop, config, time.monotonic() - begin))
        return stop.signal if loop.done < num_iterations(config) else None


def _wandb(folder: Path, config: Config) -> WandbLog | None:
    """The run on Weights & Biases, of the first process; None where it is not asked for."""
    if config.train.wandb is None or not processes.is_first():
        return None
    return WandbLog(folder, config.train.wandb, dataclasses.asdict(config))


def _writer(folder: Path, loop: Loop, config: Config, wandb: WandbLog | None) -> Any:
    """The history, which the first process writes."""
    if processes.is_first():
        return MetricsWriter(folder, loop.done, config.train.tensorboard, wandb)
    return contextlib.nullcontext(NoMetrics())


def _policy_to_begin_with(config: Config, log: Log) -> LoadedPolicy | None:
    """That of `train.init_from`, with a line if it knows another body; checks the meta policy."""
    composite = config.composite
    if composite is not None and composite.meta is not None:
        checkpoint.load_policy(composite.meta)
    if config.train.init_from is None:
        return None
    start = checkpoint.load_policy(config.train.init_from)
    motion = "composite motion" if config.composite_motion else "getting up"
    same = start.config.composite_motion == config.composite_motion
    require(same, "train.init_from", f"a policy of {motion}", config.train.init_from)
    if config.train.irregular_from is not None:
        _knows_irregular_ground(config, start)
    held = None if composite is None else equipment_of(composite.goals)
    body = body_digest(load_character(config.physics, equipment=held).model)
    warn_if_other(start.path, start.metadata, body, log)
    return start


def _knows_irregular_ground(config: Config, start: LoadedPolicy) -> LoadedPolicy:
    """That of `train.irregular_from`, where it knows what `train.init_from` does not."""
    name, where = str(config.train.irregular_from), "train.irregular_from"
    loaded = checkpoint.load_policy(name)
    require(loaded.config.terrain is not None, where, "a policy of irregular ground", name)
    expected = "none where train.init_from was trained on irregular ground itself"
    require(start.config.terrain is None, where, expected, name)
    return loaded


def _finished(folder: Path, config: Config) -> bool:
    steps = checkpoint.steps(folder / checkpoint.CHECKPOINTS)
    return bool(steps) and int(steps[-1].name) >= num_iterations(config)


def _closing(folder: Path, loop: Loop, config: Config, seconds: float) -> str:
    if loop.done < num_iterations(config):
        return f"saved {loop.saved}; continue with\n  {resume_command(folder)}"
    done = f"{count(loop.steps)} steps done, {duration(seconds)} this time"
    return f"{done}; evaluate them with\n  getup-eval --ckpt {folder}"
