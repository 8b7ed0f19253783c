"""One process of a run that is timed: an iteration for every line that it is told.

    python -m support.training_process SETTING [--coordinator HOST:PORT --processes N --process I]

SETTING is JSON: config, settings, num_envs (of all processes together), num_steps, quick. It
answers in JSON lines: what an iteration reduces, once it is ready, then the seconds of each one.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import NamedSharding, PartitionSpec

from getup_jax.cli.process_options import add_options, group_of
from getup_jax.core import device_axis
from getup_jax.rl.sharded import put
from getup_jax.runtime import processes
from getup_jax.training.run import build_job
from getup_jax.training.spread import spread
from support.setting import make_config

WARM_UP = 2  # iterations
REDUCTIONS = 50  # of the gradient, timed


def main() -> None:
    args = parse_args()
    processes.join(group_of(args))
    setting = json.loads(args.setting)
    config = make_config(argparse.Namespace(engine=None, **setting), _silent)
    job = build_job(config, _silent)
    state = jax.jit(job.learner.init)(job.world, jax.random.PRNGKey(config.seed))
    parameters = (state.learner.policy.actor, state.learner.critic)
    sizes = [sum(np.size(x) for x in jax.tree.leaves(part)) for part in parameters]
    iteration, world, state = spread(job.learner, job.world, state)
    step = jax.jit(iteration, donate_argnums=1).lower(world, state).compile()
    for _ in range(WARM_UP):
        state, _ = jax.block_until_ready(step(world, state))
    updates = config.ppo.num_envs * config.ppo.num_steps // config.ppo.minibatch_size
    answer(
        {
            "parameters": {"actor": sizes[0], "critic": sizes[1]},
            "updates": {
                "actor": updates * config.ppo.epochs,
                "critic": updates * config.ppo.critic_epochs,
            },
            "steps": config.ppo.num_envs * config.ppo.num_steps,
            "reduction_s": reduction_s(max(sizes)),
            "smallest_reduction_s": reduction_s(1),
        }
    )
    for _ in sys.stdin:
        begin = time.perf_counter()
        state, _ = jax.block_until_ready(step(world, state))
        answer(time.perf_counter() - begin)
    processes.leave()


def reduction_s(size: int) -> float:
    """Seconds of one mean over all devices of float32 numbers, one after the other."""
    if jax.device_count() == 1:
        return 0.0
    mesh = jax.sharding.Mesh(np.array(jax.devices()), (device_axis.AXIS,))
    same = PartitionSpec()

    def reduce(x: jax.Array) -> jax.Array:
        def again(_: jax.Array, x: jax.Array) -> jax.Array:
            return device_axis.averaged(x) * 0.5

        return jax.lax.fori_loop(0, REDUCTIONS, again, x)

    many = jax.shard_map(reduce, mesh=mesh, in_specs=same, out_specs=same, check_vma=False)
    x = put(jnp.ones(size, jnp.float32), NamedSharding(mesh, same))
    compiled = jax.jit(many).lower(x).compile()
    jax.block_until_ready(compiled(x))
    begin = time.perf_counter()
    jax.block_until_ready(compiled(x))
    return (time.perf_counter() - begin) / REDUCTIONS


def answer(value: Any) -> None:
    print(json.dumps(value), flush=True)


def parse_args() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("setting")
    add_options(parser)
    return parser.parse_args()


def _silent(text: str) -> None:
    """Only answers go to the standard output."""


if __name__ == "__main__":
    main()
