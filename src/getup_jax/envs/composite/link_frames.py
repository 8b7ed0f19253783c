"""What the actor and the discriminators of composite motion see: frames of the links' states."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from getup_jax.core import quaternion as rotation
from getup_jax.core.types import Kinematics

FRAMES = 4  # that the actor sees; a window has the next one too
LINK_STATE = 13  # position 3, quaternion 4, linear and angular velocity 3 each


def link_state(kinematics: Kinematics) -> jax.Array:
    """One frame of the history [B, L, LINK_STATE]."""
    return jnp.concatenate(
        [
            kinematics.link_position,
            kinematics.link_quaternion,
            kinematics.link_linear_velocity,
            kinematics.link_angular_velocity,
        ],
        axis=-1,
    )


def observe(history: jax.Array) -> jax.Array:
    """The observation [B, F * L * LINK_STATE] of frames [B, F, L, LINK_STATE] [C equation 4].

    All frames are in the heading frame of the newest root, with the origin below it on z = 0.
    """
    position, quaternion = history[..., :3], history[..., 3:7]
    linear, angular = history[..., 7:10], history[..., 10:]
    origin = position[:, -1:, :1] * jnp.array([1.0, 1.0, 0.0])
    to_heading = rotation.conjugate(rotation.heading(quaternion[:, -1:, :1]))
    blocks = [
        rotation.rotate(to_heading, position - origin),
        rotation.canonical(rotation.multiply(to_heading, quaternion)),
        rotation.rotate(to_heading, linear),
        rotation.rotate(to_heading, angular),
    ]
    return jnp.concatenate(blocks, axis=-1).reshape(len(history), -1)
