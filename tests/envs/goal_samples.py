"""Hand-made kinematics for the goals: only what they read differs from zero."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from getup_jax.core.types import Kinematics

LINKS = ("pelvis", "hand_l", "hand_r", "forearm_r", "foot_l")


def kinematics(
    position: dict[str, tuple] | None = None,
    velocity: dict[str, tuple] | None = None,
    yaw: float = 0.0,
    balls: tuple | None = None,
    ball_velocity: tuple | None = None,
) -> Kinematics:
    """One simulation (B = 1) whose links not named are at the origin, at rest; all turned by yaw.

    balls and ball_velocity: one vector a ball (m, m/s).
    """
    quaternion = np.tile([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)], (1, len(LINKS), 1))
    zeros = np.zeros((1, len(LINKS), 3), np.float32)
    prop = None if balls is None else jnp.asarray([balls], jnp.float32)
    if balls is not None and ball_velocity is None:
        ball_velocity = ((0.0, 0.0, 0.0),) * len(balls)
    return Kinematics(
        qpos=jnp.zeros((1, 7)),
        qvel=jnp.zeros((1, 6)),
        link_position=_filled(position),
        link_quaternion=jnp.asarray(quaternion, jnp.float32),
        link_angular_velocity=jnp.asarray(zeros),
        link_linear_velocity=_filled(velocity),
        torque=jnp.zeros((1, 0)),
        finite=jnp.ones(1, bool),
        prop_position=prop,
        prop_velocity=None if balls is None else jnp.asarray([ball_velocity], jnp.float32),
    )


def _filled(values: dict[str, tuple] | None) -> jnp.ndarray:
    array = np.zeros((1, len(LINKS), 3), np.float32)
    for name, value in (values or {}).items():
        array[0, LINKS.index(name)] = value
    return jnp.asarray(array)
