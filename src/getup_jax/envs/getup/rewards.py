"""The get-up reward, equations 2 to 9 of [P 5.1], and narrower kernels of the tracking in it.

Every term is a pure function.

Shapes are [...]: any leading axes. Heights are in m, angles in rad, rates in rad/s.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

TERMS = "height", "orientation", "velocity", "posture"  # of equation 4
RESERVED = (*TERMS, "task", "natural", "total", "track")  # names of all terms of the task


def height(value: jax.Array, target: jax.Array) -> jax.Array:
    """Equation 5: r_h = exp(-1.7 |h - p_h|)."""
    return jnp.exp(-1.7 * jnp.abs(value - target))


def orientation(value: jax.Array, target: jax.Array) -> jax.Array:
    """Equation 6: r_theta = exp(-1.5 (|theta_x - p_x| + |theta_z - p_z|)); inputs [..., 2]."""
    return jnp.exp(-1.5 * jnp.sum(jnp.abs(value - target), axis=-1))


def phase(target_height: jax.Array, final_height: jax.Array) -> jax.Array:
    """Equation 8: alpha = exp(-20 (1 - phi)), phi = p_h(s) / p_h(1).

    It is 1 in the standing phase and near 0 before. A curve that overshoots its end would give
    alpha > 1 and a negative share of the other term, so phi is held at 1 at most.
    """
    phi = jnp.minimum(target_height / final_height, 1.0)
    return jnp.exp(-20.0 * (1.0 - phi))


def velocity(angular_velocity: jax.Array, alpha: jax.Array) -> jax.Array:
    """Equation 7: r_v = (1 - alpha) + alpha exp(-.05 |omega|); omega [..., 57] of 19 links."""
    norm = jnp.linalg.norm(angular_velocity, axis=-1)
    return (1.0 - alpha) + alpha * jnp.exp(-0.05 * norm)


def posture(joint_angle: jax.Array, alpha: jax.Array) -> jax.Array:
    """Equation 9: r_p = (1 - alpha) + alpha exp(-.1 sum_j |log(q^_j, q_j)|); angles [..., 19]."""
    return (1.0 - alpha) + alpha * jnp.exp(-0.1 * jnp.sum(joint_angle, axis=-1))


def natural(offset: jax.Array, limit: float) -> jax.Array:
    """Equation 3: r_natural = 1 - clip((|dq|_1 / c)^2, 0, 1); dq [..., J] and c in rad."""
    share = jnp.sum(jnp.abs(offset), axis=-1) / limit
    return 1.0 - jnp.clip(share**2, 0.0, 1.0)


def task(terms: dict[str, jax.Array]) -> jax.Array:
    """Equation 4: the product of the task's terms."""
    return terms["height"] * terms["orientation"] * terms["velocity"] * terms["posture"]


def tracking(
    terms: dict[str, jax.Array], sharpness: float, of_height: float | None = None
) -> jax.Array:
    """r_h^n r_theta^k = exp(-1.7 n |dh| - 1.5 k (|dtheta_x| + |dtheta_z|)).

    k is the sharpness, n that of the height; None: k, too.
    """
    if of_height is None or of_height == sharpness:
        return (terms["height"] * terms["orientation"]) ** sharpness
    return terms["height"] ** of_height * terms["orientation"] ** sharpness


def sharpened(terms: dict[str, jax.Array], sharpness: float) -> jax.Array:
    """Equation 4 with r_h and r_theta to the power of `sharpness`; 1: equation 4 itself."""
    return terms["task"] * tracking(terms, sharpness - 1.0)


def terms(
    value: jax.Array,
    target: jax.Array,
    final_height: jax.Array,
    angular_velocity: jax.Array,
    joint_angle: jax.Array,
) -> dict[str, jax.Array]:
    """The terms of equation 4 by name, and their product as `task`.

    Features value [..., 3] and their targets [..., 3]: height, side and front angle; height of
    the curve's end [...]; omega [..., 57] and angles [..., 19] to the neutral pose's joints.
    """
    alpha = phase(target[..., 0], final_height)
    found = {
        "height": height(value[..., 0], target[..., 0]),
        "orientation": orientation(value[..., 1:], target[..., 1:]),
        "velocity": velocity(angular_velocity, alpha),
        "posture": posture(joint_angle, alpha),
    }
    return found | {"task": task(found)}
