"""Simulation alone, beside other people's humanoids at their own settings, with other bodies.

    pip install 'getup-jax[peers]' && python benchmarks/other_bodies.py [--rounds 5]

  ours        the get-up task of --config, native MuJoCo inside jit
  envpool     EnvPool's Humanoid-v4: its own threads
  playground  MuJoCo Playground's HumanoidStand: MJX, on this machine's device

Each steps its simulations with random actions for a second or more when it is its turn, and no
policy learns. Bodies, contacts, solvers and time steps differ, so that these rates compare nothing
but orders of magnitude; the physics steps/s are the better part. What is not installed is a line.
"""

from __future__ import annotations

import json
import statistics
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from support.command import command, parser_of, positive

SIMULATIONS = {"ours": 512, "envpool": 512, "playground": 64}
SECONDS = 1.0  # of a turn, at least


class Simulator(NamedTuple):
    """Some humanoid, B times."""

    degrees: int  # of freedom
    substeps: int  # physics steps in a control step
    step: Callable[[], None]  # all simulations, once
    simulations: int  # B


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--rounds", type=positive, default=5)
    args = parser.parse_args()
    makers = {"ours": ours, "envpool": envpool, "playground": playground}
    there: dict[str, Simulator] = {}
    found: dict[str, dict[str, Any]] = {}
    for name, make in makers.items():
        print(f"{name}: starting ...", flush=True)
        try:
            there[name] = make(4 if args.quick else SIMULATIONS[name], args)
        except ImportError as error:
            found[name] = {"missing": str(error)}
    rates: dict[str, list[float]] = {name: [] for name in there}
    for number in range(1 if args.quick else args.rounds):
        for name, simulator in there.items():
            rates[name].append(rate(simulator, 0.0 if args.quick else SECONDS))
            print(f"round {number + 1}: {name} {rates[name][-1]:,.0f} control steps/s", flush=True)
    for name, simulator in there.items():
        found[name] = {
            "degrees": simulator.degrees,
            "simulations": simulator.simulations,
            "substeps": simulator.substeps,
            "control_steps_per_s": statistics.median(rates[name]),
            "all": rates[name],
        }
    show(found)
    if args.json is not None:
        args.json.write_text(json.dumps(found, indent=2) + "\n")


def rate(simulator: Simulator, seconds: float) -> float:
    """Control steps/s of all simulations together."""
    begin, steps = time.perf_counter(), 0
    while steps == 0 or time.perf_counter() - begin < seconds:
        simulator.step()
        steps += simulator.simulations
    return steps / (time.perf_counter() - begin)


def ours(simulations: int, args: Any) -> Simulator:
    """A step of the task with random actions: physics, observation, reward, ends and resets."""
    import jax
    import jax.numpy as jnp

    import getup_jax as gj

    config = gj.load_config(args.config, *args.settings)
    env = gj.make_env(config, num_envs=simulations)
    state, rng = env.reset(seed=0), np.random.default_rng(0)

    def step() -> None:
        nonlocal state
        action = 0.1 * rng.standard_normal((simulations, env.action_size))
        state, _ = jax.block_until_ready(env.step(state, jnp.asarray(action, jnp.float32)))

    step()
    degrees = 6 + env.environment.character.num_joints
    return Simulator(degrees, config.physics.substeps, step, simulations)


def envpool(simulations: int, args: Any) -> Simulator:
    """As it comes, with as many threads as it takes by itself."""
    import envpool as pool  # pyright: ignore[reportMissingImports]

    env = pool.make_gymnasium("Humanoid-v4", num_envs=simulations, seed=0)
    env.reset()
    rng, size = np.random.default_rng(0), env.action_space.shape[0]

    def step() -> None:
        env.step(rng.uniform(-0.4, 0.4, (simulations, size)))

    step()
    return Simulator(23, env.spec.config.frame_skip, step, simulations)


def playground(simulations: int, args: Any) -> Simulator:
    """HumanoidStand of its DeepMind Control Suite."""
    import jax
    from mujoco_playground import registry  # pyright: ignore[reportMissingImports]

    env = registry.load("HumanoidStand")
    keys = jax.random.split(jax.random.PRNGKey(0), simulations)
    state, advance = jax.jit(jax.vmap(env.reset))(keys), jax.jit(jax.vmap(env.step))
    rng = np.random.default_rng(0)

    def step() -> None:
        nonlocal state
        action = rng.uniform(-1.0, 1.0, (simulations, env.action_size)).astype(np.float32)
        state = jax.block_until_ready(advance(state, action))

    step()
    return Simulator(env.mjx_model.nv, round(env.dt / env.sim_dt), step, simulations)


def show(found: dict[str, dict[str, Any]]) -> None:
    columns = ("whose", "degrees of freedom", "at once", "control steps/s", "physics steps/s")
    table = Table(*columns, title="simulation alone; every one is another body")
    for name, row in found.items():
        if "missing" in row:
            table.add_row(name, f"not installed: {row['missing']}")
            continue
        steps = row["control_steps_per_s"]
        physics = steps * row["substeps"]
        sizes = (str(row["degrees"]), str(row["simulations"]))
        table.add_row(name, *sizes, f"{steps:,.0f}", f"{physics:,.0f}")
    Console(width=110).print(table)


if __name__ == "__main__":
    command(main)
