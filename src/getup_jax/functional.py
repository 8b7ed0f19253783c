"""An environment as two pure functions, for training loops of one's own in JAX."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from getup_jax.config import Config
from getup_jax.core.types import StepOutput
from getup_jax.envs.composite.groups import objective_weights
from getup_jax.evaluation.composite_rollout import task_of

Reset = Callable[[Any, jax.Array], tuple[jax.Array, Any]]
Step = Callable[[Any, Any, jax.Array], tuple[jax.Array, Any, jax.Array, jax.Array, dict[str, Any]]]


class Functional(NamedTuple):
    """B episodes; `world` holds the arrays that they share, and is an argument of both."""

    # (world, key) to the observation [B, O] and the state
    reset: Reset
    # (world, state, action [B, A]) to observation [B, O], state, reward [B], done [B] and what else
    # is known: `terminated`, `truncated` [B], `final_observation` [B, O], `metrics`, `episode`
    step: Step


def make_functional(config: Config, environment: Any, num_envs: int) -> Functional:
    """The two functions of an environment; neither is jitted, both may be, inside others too.

    They are of batches: `vmap` over them is not possible on the native engine, nor needed.
    """
    weights = jnp.asarray(reward_weights(config, environment), jnp.float32)

    def reset(world: Any, key: jax.Array) -> tuple[jax.Array, Any]:
        state = environment.init(world, key, num_envs)
        return state.observation, state

    def step(world: Any, state: Any, action: jax.Array) -> Any:
        state, output = environment.step(world, state, action)
        info = {
            "terminated": output.terminated,
            "truncated": output.truncated,
            "final_observation": output.final_observation,
            "metrics": output.logged,
            "episode": output.episode,
        }
        return output.observation, state, scalar_reward(output, weights), output.done, info

    return Functional(reset, step)


def reward_weights(config: Config, environment: Any) -> tuple[float, ...]:
    """The weight of every objective [K] in one reward.

    Imitation has its weight, too, but is rewarded by discriminators, which belong to a learner;
    here it gives nothing.
    """
    if config.composite_motion:
        assert config.composite is not None
        return objective_weights(config.composite, task_of(environment).objectives)
    return tuple(environment.objective_weights.values())


def scalar_reward(output: StepOutput, weights: jax.Array) -> jax.Array:
    """The weighted sum [B] of the rewards [B, K] of a step."""
    return output.reward @ weights
