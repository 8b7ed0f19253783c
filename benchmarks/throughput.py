"""Control steps per second of the physics, of collecting experience and of training.

    python benchmarks/throughput.py [--json FILE] [--engine native] [--num-envs 512]

Four parts, timed in turn again and again, so that a busy machine slows all of them alike; the
median of the rounds is reported.

  raw        the engine alone, with the hinge targets that the rollout sends it. native: a plain
             `mujoco.batch.Batch` loop without JAX; mjx: a jitted scan
  rollout    the same control steps inside jit: policy, pose prior, observation, reward, resets
  update     values, GAE and all epochs of PPO on the rollout's samples
  iteration  one whole training iteration, as `getup-train` runs it

All start from the same lying characters, take the same number of control steps with the actions of
the untrained policy, and no episode ends meanwhile, so raw and rollout do the same physical work;
with native it is checked that they end in the same states, bit for bit.
The pose prior is untrained and the get-ups are made up: only their sizes matter here.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import platform
import statistics
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco.batch import Batch
from rich.console import Console
from rich.table import Table

from getup_jax.algo.estimate import estimate
from getup_jax.algo.learner import Learner, make_learner
from getup_jax.algo.rollout import Rollout, rollout
from getup_jax.algo.state import TrainState
from getup_jax.config import Config
from getup_jax.motion.clips import Clip, GetUp
from getup_jax.motion.curves import NUM_POINTS
from getup_jax.nets import gaussian
from getup_jax.nets.cvae import CVAE, init_variables
from getup_jax.nets.prior import PosePrior
from getup_jax.nets.prior_data import pose_conditions
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.settings import load_config
from getup_jax.tasks.build import BuiltTask, assemble
from getup_jax.tasks.episode import EpisodeState
from getup_jax.tasks.getup import GetUpTask
from getup_jax.types import PhysicsState, StepOutput

NUM_STEPS = 8  # short, so that many rounds fit; rates do not depend on it
MIN_ROUNDS = 3
POSE_STD_RAD = 0.3  # of the made-up poses that scale the prior's output

Run = Callable[[], Any]


def main() -> None:
    args = parse_args()
    config = make_config(args)
    task = make_task(config)
    learner = make_learner(
        task.environment, config.network, config.ppo, total_steps=config.train.total_steps
    )
    state = jax.jit(learner.init)(task.world, jax.random.PRNGKey(config.seed))
    parts = make_parts(config, task, learner, state)
    seconds = measure(parts, args.seconds)
    result = report(config, task, seconds)
    show(result, seconds)
    if args.json is not None:
        args.json.write_text(json.dumps(result, indent=2) + "\n")


def parse_args() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the result to this file")
    parser.add_argument("--engine", help="auto, native, mjx or mjx-warp; default: the config's")
    parser.add_argument("--num-envs", type=int, help="simulations; default: the config's")
    parser.add_argument("--num-steps", type=int, default=NUM_STEPS, help="control steps a round")
    parser.add_argument("--config", default="flat", help="a config file or a shipped config")
    parser.add_argument("--seconds", type=float, default=8.0, help="for the timed rounds")
    return parser.parse_args()


def make_config(args: argparse.Namespace) -> Config:
    """The config with lying starts, episodes that do not end and the given batch."""
    config = load_config(args.config)
    physics, ppo = config.physics, config.ppo
    if args.engine is not None:
        solver = "auto" if args.engine.startswith("mjx") else physics.solver
        physics = dataclasses.replace(physics, engine=args.engine, solver=solver)
    num_envs = args.num_envs or ppo.num_envs
    batch = num_envs * args.num_steps
    ppo = dataclasses.replace(
        ppo,
        num_envs=num_envs,
        num_steps=args.num_steps,
        minibatch_size=math.gcd(ppo.minibatch_size, batch),
    )
    task = dataclasses.replace(
        config.task, stand_start=0.0, clip_start=0.0, pool_size=num_envs, terminate_after_s=1e6
    )
    return dataclasses.replace(config, physics=physics, ppo=ppo, task=task)


def make_task(config: Config) -> BuiltTask:
    character = load_character(config.physics)
    # longer than any rollout: the time limit would end episodes, too
    duration = 1.0 + config.ppo.num_steps / config.physics.control_hz
    getups = [make_getup(character, side, duration) for side in (1.0, -1.0)]
    return assemble(config, character, getups, make_prior(config, character), lambda text: None)


def make_getup(character: CharacterSpec, side: float, duration: float) -> GetUp:
    """Straight curves from lying prone (side 1) or supine (-1) to standing."""
    lying = character.neutral_qpos.copy()
    lying[2] = 0.2
    lying[3:7] = math.cos(math.pi / 4), 0.0, side * math.sin(math.pi / 4), 0.0
    qpos = np.stack([lying, character.neutral_qpos])
    first, last = pose_conditions(qpos, character)
    clip = Clip("made up", fps=1.0 / duration, qpos=qpos)
    return GetUp("made up", duration, np.linspace(first, last, NUM_POINTS), clip)


def make_prior(config: Config, character: CharacterSpec) -> PosePrior:
    """A pose prior of the config's size with random weights."""
    rng, joints, latent = np.random.default_rng(0), character.num_joints, config.prior.latent_size
    poses = character.neutral_qpos[7:] + POSE_STD_RAD * rng.normal(size=(256, joints))
    conditions = rng.normal(1.0, 0.5, (256, 3))
    model = CVAE(joints, latent, config.prior.hidden_sizes, config.prior.conditional)
    return PosePrior(
        variables=init_variables(model, jax.random.PRNGKey(0), poses, conditions),
        latent_mean=jnp.zeros(latent),
        latent_std=jnp.ones(latent),
        joint_lower=jnp.asarray(character.joint_lower, jnp.float32),
        joint_upper=jnp.asarray(character.joint_upper, jnp.float32),
    )


def make_parts(
    config: Config, task: BuiltTask, learner: Learner, state: TrainState
) -> dict[str, Run]:
    """The four parts as functions that return when they are done; all are warmed up here."""
    world, key = task.world, jax.random.PRNGKey(1)
    options = task.environment.engine.compiler_options
    collect = jax.jit(
        lambda world, state, key: collected(learner, world, state, key), compiler_options=options
    )
    experience = collect(world, state, key)
    samples, last = experience.transition, experience.environment.physics
    if bool(jnp.any(samples.terminated | samples.truncated)):
        raise SystemExit("an episode ended during the rollout: raw and rollout would differ")
    targets, samples = np.asarray(samples.extras), samples.replace(extras=None)
    update = jax.jit(lambda state, samples, key: updated(learner, state, samples, key))
    # not donated, since every round starts from the same state
    iteration = jax.jit(learner.iteration, compiler_options=options)
    parts: dict[str, Run] = {
        "raw": raw_run(config, task.environment.engine, state, targets, last),
        "rollout": lambda: jax.block_until_ready(collect(world, state, key)),
        "update": lambda: jax.block_until_ready(update(state, samples, key)),
        "iteration": lambda: jax.block_until_ready(iteration(world, state)),
    }
    for part in parts.values():
        part()
    return parts


@dataclasses.dataclass(frozen=True)
class Recorded:
    """The task, which also gives what it sends to the engine [B, J] (rad)."""

    task: GetUpTask

    def step(
        self, world: Any, state: EpisodeState, action: jax.Array
    ) -> tuple[EpisodeState, StepOutput]:
        after, output = self.task.step(world, state, action)
        return after, output.replace(extras=self.task.servo_target(world, state, after.action))


def collected(learner: Learner, world: Any, state: TrainState, key: jax.Array) -> Rollout:
    env, policy = Recorded(learner.env), make_policy(learner, state)
    return rollout(env, world, state.environment, policy, key, learner.config.num_steps)


def make_policy(learner: Learner, state: TrainState) -> Callable:
    std = learner.stage(state).action_std

    def policy(observation: jax.Array, key: jax.Array) -> tuple[jax.Array, jax.Array]:
        mean = learner.act(state.learner.policy, observation)
        action = gaussian.sample(key, mean, std)
        return action, gaussian.log_prob(action, mean, std)

    return policy


def updated(learner: Learner, state: TrainState, samples: Any, key: jax.Array) -> Any:
    current, batch, _ = estimate(learner.model, state.learner, samples, learner.config)
    return learner._improve(current, batch, learner.stage(state), key)


def raw_run(
    config: Config, engine: Any, state: TrainState, targets: np.ndarray, last: PhysicsState
) -> Run:
    """The engine alone, from the rollout's start states to its last ones."""
    first = state.environment.physics
    if engine.name != "native":
        return scan_run(engine, first, jnp.asarray(targets))
    rows = np.array(first.engine).view(np.float64)
    threads = config.physics.threads or len(os.sched_getaffinity(0))
    batch = Batch(engine.model, len(rows), threads, persistent=True)
    stage = mujoco.mjtStage.mjSTAGE_VEL.value

    def run() -> None:
        batch.state[...] = rows
        for ctrl in targets:
            batch.ctrl = ctrl
            batch.step(nstep=config.physics.substeps, stage=stage)

    run()
    if not np.array_equal(batch.state, np.array(last.engine).view(np.float64)):
        raise SystemExit("raw and rollout end in different states: their rates do not compare")
    return run


def scan_run(engine: Any, first: PhysicsState, targets: jax.Array) -> Run:
    def play(state: PhysicsState, targets: jax.Array) -> PhysicsState:
        return jax.lax.scan(lambda s, ctrl: (engine.step(s, ctrl), None), state, targets)[0]

    compiled = jax.jit(play, compiler_options=engine.compiler_options)
    return lambda: jax.block_until_ready(compiled(first, targets))


def measure(parts: dict[str, Run], budget_s: float) -> dict[str, list[float]]:
    """Seconds of every part in every round."""
    seconds: dict[str, list[float]] = {name: [] for name in parts}
    begin = time.perf_counter()
    while len(seconds["raw"]) < MIN_ROUNDS or time.perf_counter() - begin < budget_s:
        for name, part in parts.items():
            start = time.perf_counter()
            part()
            seconds[name].append(time.perf_counter() - start)
    return seconds


def report(config: Config, task: BuiltTask, seconds: dict[str, list[float]]) -> dict[str, Any]:
    ppo, physics = config.ppo, config.physics
    steps = ppo.num_envs * ppo.num_steps
    rates = {name: steps / statistics.median(times) for name, times in seconds.items()}
    return {
        **{name: round(rate, 1) for name, rate in rates.items()},
        "rollout_ratio": round(rates["rollout"] / rates["raw"], 4),
        "iteration_ratio": round(rates["iteration"] / rates["raw"], 4),
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("getup-jax", "jax", "mujoco", "mujoco-mjx")},
        },
        "machine": {
            "processor": processor(),
            "cpus": len(os.sched_getaffinity(0)),
            "device": jax.devices()[0].device_kind,
            "system": platform.platform(),
        },
        "settings": {
            "engine": task.environment.engine.name,
            "solver": physics.solver,
            "substeps": physics.substeps,
            "iterations": physics.iterations,
            "num_envs": ppo.num_envs,
            "num_steps": ppo.num_steps,
            "epochs": ppo.epochs,
            "minibatch_size": ppo.minibatch_size,
            "hidden_sizes": list(config.network.hidden_sizes),
            "rounds": len(seconds["raw"]),
        },
    }


def processor() -> str:
    """The CPU's name, where the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def show(result: dict[str, Any], seconds: dict[str, list[float]]) -> None:
    settings, machine = result["settings"], result["machine"]
    title = "{engine}, {num_envs} simulations x {num_steps} steps, {rounds} rounds"
    title = title.format(**settings)
    table = Table("part", "control steps/s", "of raw", "fastest", "slowest", title=title)
    steps = settings["num_envs"] * settings["num_steps"]
    for name, times in seconds.items():
        table.add_row(
            name,
            f"{result[name]:,.0f}",
            f"{result[name] / result['raw']:.2f}",
            f"{steps / min(times):,.0f}",
            f"{steps / max(times):,.0f}",
        )
    console = Console(width=100)
    console.print(table)
    console.print(f"{machine['processor']}, {machine['cpus']} CPUs; {machine['device']}")


if __name__ == "__main__":
    main()
