"""Generalised advantage estimation with separate termination and truncation."""

from __future__ import annotations

import chex
import jax
import jax.numpy as jnp


def gae(
    reward: jax.Array,
    value: jax.Array,
    next_value: jax.Array,
    terminated: jax.Array,
    truncated: jax.Array,
    discount: float | jax.Array,
    gae_lambda: float,
) -> tuple[jax.Array, jax.Array]:
    """Advantages and value targets of T steps (Schulman et al. 2016, equations 11 to 16).

        delta_t     = r_t + discount * next_value_t * (1 - terminated_t) - value_t
        advantage_t = delta_t + discount * lambda * (1 - ended_t) * advantage_{t+1}
        target_t    = advantage_t + value_t,    ended = terminated or truncated

    A truncated episode would have gone on, so its next value counts; but the next row is another
    episode, so the trace is cut (Pardo et al. 2018). A step that is both is a termination.

    Args:
        reward: [T, B] or [T, B, K].
        value: like reward, the critic on the observation that the step was taken from.
        next_value: like reward, the critic on the observation reached, BEFORE any reset. It is
            not read where terminated, and may be NaN there.
        terminated: [T, B] bool.
        truncated: [T, B] bool.
        discount: per step; one, or [K].
        gae_lambda: 0 is one-step temporal difference, 1 is Monte Carlo.

    Returns:
        advantage and target, both like reward.
    """
    chex.assert_equal_shape([reward, value, next_value])
    chex.assert_shape([terminated, truncated], reward.shape[:2])
    per_objective = terminated.shape + (1,) * (reward.ndim - terminated.ndim)
    ended = jnp.reshape(terminated | truncated, per_objective)
    bootstrap = jnp.where(jnp.reshape(terminated, per_objective), 0.0, next_value)
    delta = reward + discount * bootstrap - value

    def accumulate(following: jax.Array, row: tuple[jax.Array, jax.Array]):
        delta_t, ended_t = row
        advantage_t = delta_t + jnp.where(ended_t, 0.0, discount * gae_lambda * following)
        return advantage_t, advantage_t

    start = jnp.zeros_like(delta[0])
    _, advantage = jax.lax.scan(accumulate, start, (delta, ended), reverse=True)
    return advantage, advantage + value
