"""What iterations on meshes of 1, 2 and 4 virtual devices give, as JSON; see test_sharded.py.

A process has as many devices as XLA_FLAGS says when it starts, so this is one of its own. Its
arguments say which.
"""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import tiny_composite
from jax.sharding import PartitionSpec
from tiny_task import CONFIG as TINY
from tiny_task import tiny_task

from getup_jax.config import CurriculumConfig, NetworkConfig, PPOConfig
from getup_jax.core import device_axis
from getup_jax.envs.composite.discriminator_rewards import make_discriminator_rewards
from getup_jax.physics.character import load_character
from getup_jax.rl.learner import Learner, make_learner
from getup_jax.rl.sharded import SPLIT, Placement, place
from getup_jax.rl.state import TrainState
from probes import Probe, make_world

NETWORK = NetworkConfig(hidden_sizes=(16,), activation="tanh")
# one minibatch of all samples, so that the order of the shuffled samples is only that of a sum
PPO = PPOConfig(num_envs=16, num_steps=8, epochs=1, critic_epochs=1, minibatch_size=128)
MESHES = (2, 4)


def probe_learner() -> tuple[Learner, Any]:
    """Everything that reduces over simulations: two objectives, PopArt, statistics, adaptation."""
    config = PPOConfig(**{**PPO.__dict__, "popart": True, "target_clip_fraction": 0.1})
    learner = make_learner(Probe(scale=(1.0, 100.0)), NETWORK, config, total_steps=10_000)
    return learner, make_world(3, by_sign=1.0, by_action=1.0, action_by_sign=0.5, shows_step=1.0)


def gap(a: Any, b: Any, least: float = 1e-12) -> float:
    """The largest difference of two pytrees, beside the largest number of its array, or `least`."""

    def relative(x: jax.Array, y: jax.Array) -> float:
        x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
        known = ~(np.isnan(x) & np.isnan(y))
        size = np.max(np.abs(y), initial=least, where=known)
        return float(np.max(np.abs(x - y), initial=0.0, where=known) / size)

    return max(map(relative, jax.tree.leaves(a), jax.tree.leaves(b)))


def same_samples() -> dict[str, float]:
    """How far the state is from one device's after two iterations with the same samples."""
    learner, world = probe_learner()
    state = jax.jit(learner.init)(world, jax.random.PRNGKey(0))
    state, _ = jax.jit(learner.iteration)(world, state)  # the first one only collects statistics
    collected = jax.jit(learner.collect)(world, state)
    alone, metrics = jax.jit(learner.learn)(world, state, collected)
    found = {"moved": gap(state.learner.policy.actor, alone.learner.policy.actor)}
    for number in MESHES:
        placement = place(learner, world, jax.devices()[:number])
        learn = _spread_learn(learner, placement, collected)
        after, of_mesh = jax.jit(learn)(world, state, collected)
        found[f"state {number}"] = gap(after.learner, alone.learner)
        found[f"metrics {number}"] = gap(of_mesh, metrics, least=1.0)
    return found


def _spread_learn(learner: Learner, placement: Placement, collected: Any) -> Callable[..., Any]:
    steps_split = PartitionSpec(None, device_axis.AXIS)
    of_rollout = jax.tree.map(lambda _: steps_split, collected)
    of_rollout = of_rollout.replace(environment=placement.specs.environment)
    specs = placement.specs
    return jax.shard_map(
        learner.learn,
        mesh=placement.mesh,
        in_specs=(PartitionSpec(), specs, of_rollout),
        out_specs=(specs, PartitionSpec()),
        check_vma=False,
    )


def getup_run(number: int) -> dict[str, Any]:
    """Getting up on the native engine, with the curriculum's counters."""
    curriculum = CurriculumConfig(prioritisation=0.9, short_share=0.5, assistive_wrench=0.5)
    config = dataclasses.replace(TINY, curriculum=curriculum)
    built = tiny_task(load_character(config.physics), config)
    ppo = PPOConfig(num_envs=8, num_steps=4, epochs=1, critic_epochs=1, minibatch_size=16)
    learner = make_learner(built.environment, NETWORK, ppo, total_steps=10_000)
    return two_iterations(learner, built.world, number)


def composite_run(number: int) -> dict[str, Any]:
    """Composite motion, with discriminators."""
    config = tiny_composite.CONFIG
    built = tiny_composite.tiny_composite(load_character(config.physics), config)
    rewards = make_discriminator_rewards(built.environment, built.environment.config)
    learner = make_learner(
        built.environment, config.network, config.ppo, 10_000, reward_model=rewards
    )
    return two_iterations(learner, built.world, number)


def two_iterations(learner: Learner, of_one: Any, number: int) -> dict[str, Any]:
    """What is seen of them, from the same simulations in each device's part."""
    placement = place(learner, of_one, jax.devices()[:number])
    state = jax.jit(learner.init)(of_one, jax.random.PRNGKey(0))
    state = placement.put_state(_repeated(state, placement, number))
    world = placement.put_world(of_one)
    step = jax.jit(placement.spread(learner.iteration), donate_argnums=1)
    for _ in range(2):
        state, metrics = step(world, state)
    same = jax.tree.map(lambda x, s: None if s == SPLIT else x, state, placement.specs)
    observations = np.asarray(state.environment.observation).reshape(number, -1)
    return {
        "finite": all(np.isfinite(np.asarray(x)).all() for x in jax.tree.leaves(state.learner)),
        "same on all": device_axis.same_on_all(same),
        "parts differ": len(np.unique(observations, axis=0)) == number,
        "programs": step._cache_size(),
        "physics": float(metrics["rollout/ended_not_finite"]),
    }


def _repeated(state: TrainState, placement: Placement, number: int) -> TrainState:
    """The state with the first part of the simulations in every part."""

    def repeat(x: jax.Array, spec: PartitionSpec) -> jax.Array:
        if spec != SPLIT:
            return x
        return jnp.tile(x[: len(x) // number], (number, *(1,) * (x.ndim - 1)))

    return jax.tree.map(repeat, state, placement.specs)


if __name__ == "__main__":
    parts = {
        "samples": same_samples,
        "getup": lambda: getup_run(4),
        "composite": lambda: composite_run(2),
    }
    json.dump({name: parts[name]() for name in sys.argv[1:]}, sys.stdout)
