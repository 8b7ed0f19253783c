"""How long a meta policy stays upright while hinges with new clips follow these, not its targets.

    python benchmarks/handover.py [CONFIG] [key=value ...] [--quick]

CONFIG: a YAML file with composite.meta and composite.rehearse (default:
configs/composite_walk_aim.yaml). From starts along the clips, the new hinges' targets are those of
their clips for a second, and then held, but for the share of the meta policy in the first column;
all others are the meta policy's. Nothing is learned. Printed is the share of the episodes that have
not fallen yet.
"""

from __future__ import annotations

import argparse
import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config.load import load_config
from getup_jax.envs.composite.build import build_composite
from getup_jax.envs.composite.meta.chain import with_meta
from getup_jax.evaluation.composite_rollout import without_noise
from getup_jax.imitation.dagger import clip_targets
from support.command import command

SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)
EPISODES, SECONDS = 64, 4
QUICK = 8, 1  # episodes, s


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("config", nargs="?", default="configs/composite_walk_aim.yaml")
    parser.add_argument("settings", nargs="*", metavar="key=value")
    parser.add_argument("--quick", action="store_true", help="few short episodes, one share")
    args = parser.parse_intermixed_args()
    config = load_config(args.config, args.settings)
    shares = SHARES[:1] if args.quick else SHARES
    episodes, seconds = QUICK if args.quick else (EPISODES, SECONDS)
    built = build_composite(config, print)
    env, world = with_meta(config, built)
    env = without_noise(env)
    scale, centre = np.asarray(built.world.target_scale), np.asarray(built.world.target_centre)
    rate = round(1.0 / env.task.engine.control_dt)

    def alive(targets: jax.Array, state: Any) -> jax.Array:
        def step(carry: Any, target: jax.Array) -> tuple[Any, jax.Array]:
            state, upright = carry
            meta = state.observation[:, -env.meta_size :]
            action = jnp.where(jnp.asarray(env.new), (target - centre) / scale, meta)
            state, output = env.advance(world, state, action)
            upright &= output.metrics["ended_fall"] == 0
            return (state, upright), jnp.mean(upright)

        first = (state, jnp.ones(episodes, bool))
        return jax.lax.scan(step, first, targets)[1]

    print("share of the meta policy, and of the episodes upright after 1, 2, ... s")
    run = jax.jit(alive)
    clips = clip_targets(built)[:, 0]
    whole = np.flatnonzero(np.isfinite(clips).all(axis=(1, 2)))
    row = np.random.default_rng(0).choice(whole, episodes)
    ahead = np.minimum(np.arange(seconds * rate), clips.shape[1] - 1)
    targets = jnp.asarray(clips[row][:, ahead].swapaxes(0, 1), jnp.float32)
    for share in shares:
        started = built.environment.start(built.world, jnp.asarray(row), jax.random.PRNGKey(0))
        held = dataclasses.replace(env, first_share=share)
        state = held.adopt(world, started, started.goals, jax.random.PRNGKey(1))
        found = np.asarray(run(targets, state))
        print(f"{share:.2f}  " + "  ".join(f"{x:.2f}" for x in found[rate - 1 :: rate]), flush=True)


if __name__ == "__main__":
    command(main)
