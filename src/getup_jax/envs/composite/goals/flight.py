"""Free flight of a ball, without air."""

from __future__ import annotations

import jax
import jax.numpy as jnp

GRAVITY = 9.81  # m/s^2
_DOWN = (0.0, 0.0, -GRAVITY)


def throw(start: jax.Array, end: jax.Array, time: float) -> jax.Array:
    """Velocity [..., 3] (m/s) that carries a ball from start to end [..., 3] (m) in a time (s)."""
    return (end - start) / time - 0.5 * jnp.asarray(_DOWN) * time


def landing(position: jax.Array, velocity: jax.Array) -> jax.Array:
    """Where on the floor [..., 2] (m) a ball comes down from position with velocity [..., 3]."""
    floor = jnp.minimum(position[..., 2], 0.0)
    return flown(position, velocity, descent(position, velocity, floor))[..., :2]


def descent(position: jax.Array, velocity: jax.Array, height: jax.Array) -> jax.Array:
    """Time [...] (s) until a ball comes down to a height [...] (m).

    Or to its highest point, where that is lower; 0 for a ball that has fallen past the height.
    """
    up = velocity[..., 2]
    square = jnp.square(up) + 2.0 * GRAVITY * (position[..., 2] - height)
    return jnp.maximum(up + jnp.sqrt(jnp.maximum(square, 0.0)), 0.0) / GRAVITY


def flown(position: jax.Array, velocity: jax.Array, time: jax.Array) -> jax.Array:
    """Where a ball is [..., 3] (m) after a time [...] (s) of flight."""
    time = time[..., None]
    return position + velocity * time + 0.5 * jnp.asarray(_DOWN) * jnp.square(time)


def kick(before: jax.Array, after: jax.Array, time: float) -> jax.Array:
    """Speed (m/s) [...] that something else than gravity has added in a time (s)."""
    return jnp.linalg.norm(after - before - jnp.asarray(_DOWN) * time, axis=-1)
