"""Quaternions (w x y z, unit) over any leading axes."""

from __future__ import annotations

import jax
import jax.numpy as jnp


def conjugate(q: jax.Array) -> jax.Array:
    """Inverse rotation."""
    return q * jnp.array([1.0, -1.0, -1.0, -1.0])


def multiply(a: jax.Array, b: jax.Array) -> jax.Array:
    """Rotation b, then a."""
    aw, ax, ay, az = jnp.moveaxis(a, -1, 0)
    bw, bx, by, bz = jnp.moveaxis(b, -1, 0)
    return jnp.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def rotate(q: jax.Array, v: jax.Array) -> jax.Array:
    """Vectors v [..., 3] turned by q [..., 4]: v + 2 w (u x v) + 2 u x (u x v)."""
    w, u = q[..., :1], q[..., 1:]
    t = 2.0 * jnp.cross(u, v)
    return v + w * t + jnp.cross(u, t)


def canonical(q: jax.Array) -> jax.Array:
    """The one of q and -q with w >= 0."""
    return jnp.where(q[..., :1] < 0.0, -q, q)


def angle(q: jax.Array) -> jax.Array:
    """Rotation angle in [0, pi]: the norm of the log map."""
    return 2.0 * jnp.arctan2(jnp.linalg.norm(q[..., 1:], axis=-1), jnp.abs(q[..., 0]))


def heading(q: jax.Array) -> jax.Array:
    """The twist of q about the vertical, as a quaternion.

    The swing-twist decomposition is continuous in every roll from prone over a side to supine,
    where a projected forward axis vanishes. Upside down it is undefined; the identity is given.
    """
    w, z = q[..., 0], q[..., 3]
    norm = jnp.sqrt(w * w + z * z)
    safe = jnp.maximum(norm, 1e-6)
    upside_down = norm < 1e-6
    zero = jnp.zeros_like(w)
    return jnp.stack(
        [jnp.where(upside_down, 1.0, w / safe), zero, zero, jnp.where(upside_down, 0.0, z / safe)],
        axis=-1,
    )


def about_z(yaw: jax.Array) -> jax.Array:
    """Rotation by yaw [...] (rad) about the vertical."""
    zero = jnp.zeros_like(yaw)
    return jnp.stack([jnp.cos(yaw / 2), zero, zero, jnp.sin(yaw / 2)], axis=-1)
