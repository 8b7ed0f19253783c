"""Collecting experience: T steps of all B simulations under one policy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.core import device_axis
from getup_jax.core.types import Environment, StepOutput, check_output

# (observation [B, O], key) -> (action [B, A], log_prob [B])
Policy = Callable[[jax.Array, jax.Array], tuple[jax.Array, jax.Array]]


@struct.dataclass
class Transition:
    """One step of B simulations; after a rollout every field has a leading axis T."""

    observation: jax.Array  # [B, O] raw, that the action was chosen for
    action: jax.Array  # [B, A]
    log_prob: jax.Array  # [B] of the action, by the policy that chose it
    reward: jax.Array  # [B, K]
    terminated: jax.Array  # [B] bool
    truncated: jax.Array  # [B] bool
    final_observation: jax.Array  # [B, O] raw, reached by the step, before any reset
    extras: Any  # pytree [B, ...] from the environment, or None


@struct.dataclass
class Rollout:
    """What T steps gave."""

    environment: Any  # the environment's state after the last step
    transition: Transition  # [T, B, ...]
    metrics: dict[str, jax.Array]  # name -> [T, B]
    episode: dict[str, jax.Array]  # name -> [T, B], meant where an episode ended


def rollout(
    env: Environment, world: Any, environment: Any, policy: Policy, key: jax.Array, num_steps: int
) -> Rollout:
    """Scan `num_steps` steps from the environment's state; critics are evaluated afterwards."""

    def act_and_step(environment: Any, key_step: jax.Array):
        action, log_prob = policy(environment.observation, key_step)
        following, output = env.step(world, environment, action)
        check_output(env, action, output)
        transition = _transition(environment.observation, action, log_prob, output)
        return following, (transition, output.logged, output.episode)

    keys = jax.random.split(key, num_steps)
    environment, (transition, metrics, episode) = jax.lax.scan(act_and_step, environment, keys)
    return Rollout(environment=environment, transition=transition, metrics=metrics, episode=episode)


def _transition(
    observation: jax.Array, action: jax.Array, log_prob: jax.Array, output: StepOutput
) -> Transition:
    return Transition(
        observation=observation,
        action=action,
        log_prob=log_prob,
        reward=output.reward,
        terminated=output.terminated,
        truncated=output.truncated,
        final_observation=output.final_observation,
        extras=output.extras,
    )


def summarize(collected: Rollout) -> dict[str, jax.Array]:
    """The rollout's metrics as float32 scalars.

    rollout/NAME is the mean over all steps. episode/NAME is the mean over the episodes that ended
    and whose value is not NaN, or NaN if there were none; so is episode/terminated_share, the share
    of them that failed. episode/count is how many ended.
    """
    ended = collected.transition.terminated | collected.transition.truncated
    failed = collected.transition.terminated.astype(jnp.float32)
    means = {f"rollout/{name}": jnp.mean(x) for name, x in collected.metrics.items()}
    result = device_axis.averaged(means)
    for name, x in collected.episode.items():
        result[f"episode/{name}"] = masked_mean(x, ended & ~jnp.isnan(x))
    result["episode/count"] = device_axis.summed(jnp.sum(ended))
    result["episode/terminated_share"] = masked_mean(failed, ended)
    return {name: x.astype(jnp.float32) for name, x in result.items()}


def masked_mean(x: jax.Array, mask: jax.Array) -> jax.Array:
    """Mean of x where mask (same shape) is True, NaN if it is True nowhere; float32 scalar."""
    total = device_axis.summed(jnp.sum(jnp.where(mask, x, 0.0)))
    count = device_axis.summed(jnp.sum(mask))
    return jnp.where(count > 0, total / jnp.maximum(count, 1), jnp.nan)
