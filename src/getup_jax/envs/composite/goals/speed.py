"""The reward of going at a wanted velocity, which two goals share."""

from __future__ import annotations

import jax
import jax.numpy as jnp


def velocity_reward(velocity: jax.Array, wanted: jax.Array) -> jax.Array:
    """exp(-3 |v - v*|^2 / |v*|^2) of velocities [B, 2] on the floor (m/s)."""
    error = jnp.sum(jnp.square(velocity - wanted), axis=-1)
    return jnp.exp(-3.0 * error / jnp.maximum(jnp.sum(jnp.square(wanted), axis=-1), 1e-6))
