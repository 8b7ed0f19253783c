"""Control steps per second of the physics, of collecting experience and of training.

    python benchmarks/throughput.py [--config flat] [--json FILE] [section.key=value ...]

For every shipped config and those of your own. All rows are control steps/s of all simulations
together (one simulation at 30 Hz would need 30), timed in turn again and again, so that a busy
machine slows all of them alike. Reported are the median of the rounds, the fastest and the slowest
one, and the median of the rounds' ratios to raw.

  raw        the engine alone, given what the rollout gives it: hinge targets, forces of the helping
             hand, balls, states of episodes that start anew. native: a plain `mujoco.batch.Batch`
             loop without JAX, checked to come to the rollout's states in every step, bit for bit;
             mjx: a jitted scan
  rollout    the same control steps inside jit: policy, pose prior, observation, reward, resets
  update     the rest of an iteration, on the rollout's samples: discriminators, values, GAE and all
             epochs of PPO
  iteration  one whole training iteration, the first one again and again
  training   training as it runs: one iteration after the other, from the state that --warm-up
             seconds of training lead to, with the resets of the episodes that end meanwhile

The first four begin with the first episodes and take the same steps; there hardly an episode ends.
The policy is untrained, whatever train.init_from names: bodies fall soon, so that resets are as
frequent as they get; how many episodes ended is said below the table. The task and its start states
are the config's own, but for their number (as many as simulations). A pose prior that is neither
shipped nor in the cache is trained first. Where recordings that the config names are not here, the
authored motions stand in for them.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import platform
import statistics
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
from rich.console import Console
from rich.table import Table

from getup_jax.config import Config
from getup_jax.rl.state import TrainState
from getup_jax.training.run import build_job
from support.command import command, duration, parser_of, positive
from support.replay import Run, engine_of, raw_run
from support.setting import make_config

UNIT = "control steps/s"
RAW, TRAINING = "raw", "training"
WARM_UP_S = (
    3.0  # simulated; falls come after a second at the latest, and at different times by then
)
MIN_ROUNDS = 3


def main() -> None:
    args = parse_args()
    config = make_config(args, print)
    parts = Parts.of(config, args)
    seconds = measure(parts.runs, 0.0 if args.quick else args.seconds)
    result = report(config, parts, seconds)
    show(result)
    if args.json is not None:
        args.json.write_text(json.dumps(result, indent=2) + "\n")


def parse_args() -> argparse.Namespace:
    parser = parser_of(__doc__)
    add = parser.add_argument
    add("--engine", help="auto, native, mjx or mjx-warp; default: the config's")
    add("--num-envs", type=positive, metavar="N", help="simulations; default: the config's")
    add("--num-steps", type=positive, metavar="N", help="control steps a round (default: 8)")
    add("--seconds", type=duration, default=8.0, metavar="S", help="of timed rounds (default: 8)")
    add("--warm-up", type=duration, default=WARM_UP_S, metavar="S", help="simulated (default: 3)")
    return parser.parse_intermixed_args()


@dataclasses.dataclass(frozen=True)
class Parts:
    """What is timed."""

    runs: dict[str, Run]  # each returns when it is done
    training: Training
    engine: str

    @classmethod
    def of(cls, config: Config, args: argparse.Namespace) -> Parts:
        """The five parts, all compiled and warmed up."""
        job = build_job(config, print)
        learner, engine = job.learner, engine_of(job.learner.env)
        options = engine.compiler_options
        world = jax.device_put(job.world)
        state = jax.jit(learner.init)(world, jax.random.PRNGKey(config.seed))
        collect = jax.jit(learner.collect, compiler_options=options)
        learn = jax.jit(learner.learn)
        # not donated, since the first one is repeated
        iterate = jax.jit(learner.iteration, compiler_options=options)
        collected, training = collect(world, state), Training(iterate, world, state)
        runs: dict[str, Run] = {
            RAW: raw_run(learner, config.physics, world, state),
            "rollout": lambda: jax.block_until_ready(collect(world, state)),
            "update": lambda: jax.block_until_ready(learn(world, state, collected)),
            "iteration": lambda: jax.block_until_ready(iterate(world, state)),
            TRAINING: training.run,
        }
        for run in runs.values():
            run()
        training.warm_up(args.warm_up, config.ppo.num_steps * engine.control_dt)
        return cls(runs, training, engine.name)


class Training:
    """Iterations one after the other; what they say of episodes is kept."""

    def __init__(self, iterate: Any, world: Any, state: TrainState) -> None:
        self._iterate, self._world, self._state = iterate, world, state
        self.ended: list[float] = []  # episodes that ended, an iteration

    def run(self) -> None:
        """The next iteration."""
        self._state, metrics = jax.block_until_ready(self._iterate(self._world, self._state))
        self.ended.append(float(metrics["episode/count"]))

    def warm_up(self, seconds: float, iteration_s: float) -> None:
        """Iterations for so many simulated seconds; their episodes do not count."""
        for _ in range(round(seconds / iteration_s)):
            self.run()
        self.ended.clear()


def measure(parts: dict[str, Run], budget_s: float) -> dict[str, list[float]]:
    """Seconds of every part in every round."""
    seconds: dict[str, list[float]] = {name: [] for name in parts}
    begin = time.perf_counter()
    while len(seconds[RAW]) < MIN_ROUNDS or time.perf_counter() - begin < budget_s:
        for name, part in parts.items():
            start = time.perf_counter()
            part()
            seconds[name].append(time.perf_counter() - start)
    return seconds


def rates(seconds: list[float], raw: list[float], steps: int) -> dict[str, float]:
    """Of one part: median and spread of its rounds (control steps/s), and of its ratios to raw."""
    of_raw = statistics.median(r / s for r, s in zip(raw, seconds, strict=True))
    found = [steps / statistics.median(seconds), steps / max(seconds), steps / min(seconds)]
    names = ("median", "slowest", "fastest")
    return {n: round(x, 1) for n, x in zip(names, found, strict=True)} | {
        "of_raw": round(of_raw, 4)
    }


def report(config: Config, parts: Parts, seconds: dict[str, list[float]]) -> dict[str, Any]:
    """Plain values for JSON."""
    ppo, physics = config.ppo, config.physics
    steps, rounds = ppo.num_envs * ppo.num_steps, len(seconds[RAW])
    ended = sum(parts.training.ended) / (rounds * steps)
    return {
        "unit": UNIT,
        "parts": {name: rates(times, seconds[RAW], steps) for name, times in seconds.items()},
        "episodes_ended_per_1000_steps": round(1000 * ended, 2),
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
            "engine": parts.engine,
            "solver": physics.solver,
            "substeps": physics.substeps,
            "iterations": physics.iterations,
            "num_envs": ppo.num_envs,
            "num_steps": ppo.num_steps,
            "epochs": ppo.epochs,
            "minibatch_size": ppo.minibatch_size,
            "hidden_sizes": list(config.network.hidden_sizes),
            "motions": list(config.motion.source),
            "rounds": rounds,
        },
    }


def processor() -> str:
    """The CPU's name, where the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def show(result: dict[str, Any]) -> None:
    settings, machine = result["settings"], result["machine"]
    title = "{engine}, {num_envs} simulations x {num_steps} steps, {rounds} rounds"
    table = Table("part", UNIT, "of raw", "slowest", "fastest", title=title.format(**settings))
    for name, row in result["parts"].items():
        label = "training as it runs" if name == TRAINING else name
        found = [f"{row[key]:,.0f}" for key in ("median", "slowest", "fastest")]
        table.add_row(label, found[0], f"{row['of_raw']:.2f}", *found[1:])
    console = Console(width=100)
    console.print(table)
    ended = result["episodes_ended_per_1000_steps"]
    console.print(f"training as it runs: {ended:g} episodes ended in 1,000 control steps")
    console.print(f"{machine['processor']}, {machine['cpus']} CPUs; {machine['device']}")


if __name__ == "__main__":
    command(main)
