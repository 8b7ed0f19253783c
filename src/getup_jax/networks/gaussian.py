"""The diagonal normal distribution N(mean, diag(std^2)) of actions; A is the action's size.

Everywhere mean and value are [..., A], std broadcasts to them, and the last axis is summed.
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp

_LOG_2PI = math.log(2.0 * math.pi)


def sample(key: jax.Array, mean: jax.Array, std: jax.Array) -> jax.Array:
    """mean + std * noise with standard normal noise, [..., A]."""
    return mean + std * jax.random.normal(key, mean.shape, mean.dtype)


def log_prob(value: jax.Array, mean: jax.Array, std: jax.Array) -> jax.Array:
    """Log-density of value: -1/2 sum(((value - mean)/std)^2 + 2 log std + log 2 pi), [...]."""
    z = (value - mean) / std
    return -0.5 * jnp.sum(jnp.square(z) + 2.0 * jnp.log(std) + _LOG_2PI, axis=-1)


def entropy(std: jax.Array) -> jax.Array:
    """Differential entropy sum(log std + (1 + log 2 pi)/2), [...] for std[..., A] (nats)."""
    return jnp.sum(jnp.log(std) + 0.5 * (1.0 + _LOG_2PI), axis=-1)


def kl(mean_p: jax.Array, std_p: jax.Array, mean_q: jax.Array, std_q: jax.Array) -> jax.Array:
    """KL(p || q), [...] (nats); for one std it is |mean_p - mean_q|^2 / (2 std^2).

    sum(log(std_q/std_p) + (std_p^2 + (mean_p - mean_q)^2) / (2 std_q^2) - 1/2)
    """
    ratio = std_p / std_q
    gap = (mean_p - mean_q) / std_q
    return 0.5 * jnp.sum(jnp.square(ratio) + jnp.square(gap) - 1.0 - 2.0 * jnp.log(ratio), axis=-1)
