"""What a goal task is: its state, observation, reward, termination and how to draw it.

A goal is a frozen dataclass of settings. All functions are pure, over B simulations, and read
the Kinematics alone, so that any number of goals combine (`combine.Goals`) and run inside jit.
"""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from getup_jax.core import quaternion
from getup_jax.core.types import Kinematics, PropCommand
from getup_jax.physics.props import Ball

REQUIRED = object()  # default of an order's number that must be given
HELD_S = 1.0  # time left (s) of a target that is held until another order


@struct.dataclass
class GoalOutput:
    """What a goal says about one control step."""

    reward: jax.Array  # [B] in [0, 1]
    terminated: jax.Array  # [B] bool, the goal has failed for good
    success: jax.Array  # [B] 1 or 0 where an attempt ended in this step, else NaN


@dataclasses.dataclass(frozen=True, eq=False)
class Marker:
    """A shape to draw: a sphere, or an arrow from `position` along `reach`."""

    position: np.ndarray  # [3] m
    reach: np.ndarray | None = None  # [3] m; None: a sphere
    radius: float = 0.05  # m
    rgba: tuple[float, float, float, float] = (0.9, 0.2, 0.2, 0.8)


class Goal(Protocol):
    """One goal task. `settings` of a config are the dataclass' fields with a default.

    A class that derives from it needs `name`, `observation_size`, `reset`, `step` and `observe`;
    the others are as for a goal without direction, balls, markers and orders.
    """

    name: ClassVar[str]
    observation_size: ClassVar[int]  # G, the size of the goal state g
    balls: ClassVar[tuple[Ball, ...]] = ()  # it plays with, in the order of its PropCommand

    def reset(self, key: jax.Array, kinematics: Kinematics) -> Any:
        """State of B fresh episodes: a pytree of leaves [B, ...]."""
        ...

    def step(self, key: jax.Array, state: Any, kinematics: Kinematics) -> tuple[Any, GoalOutput]:
        """After a control step: its reward, and the state with any new target."""
        ...

    def toward(self, state: Any, kinematics: Kinematics, bearing: jax.Array) -> Any:
        """The state with its target at a bearing [B] (rad, left of where the root faces).

        A goal without a direction on the floor stays as it is.
        """
        return state

    def observe(self, state: Any, kinematics: Kinematics) -> jax.Array:
        """The goal state g [B, G] of the policy, in the heading frame of the root."""
        ...

    def command(self, state: Any, kinematics: Kinematics) -> PropCommand | None:
        """Where the balls are put before the next control step; None where it has none."""
        return None

    def markers(self, state: Any, kinematics: Kinematics) -> list[Marker]:
        """What to draw for one episode, given rows without the axis B. Host only."""
        return []

    def steer(self, state: Any, order: dict[str, Any], age_s: float) -> Any:
        """The state with the target of an order of that age; asked again every control step.

        Orders are the numbers that `orders` of a goal names, each with its count and default.
        """
        return state


def heading_frame(kinematics: Kinematics, vector: jax.Array) -> jax.Array:
    """World vectors [B, 3] in the heading frame of the root."""
    heading = quaternion.heading(kinematics.link_quaternion[:, 0])
    return quaternion.rotate(quaternion.conjugate(heading), vector)


def floor_frame(kinematics: Kinematics, vector: jax.Array) -> jax.Array:
    """World vectors on the floor [B, 2] in the heading frame of the root [B, 2]."""
    flat = jnp.concatenate([vector, jnp.zeros_like(vector[:, :1])], axis=-1)
    return heading_frame(kinematics, flat)[:, :2]


def root_heading(kinematics: Kinematics) -> jax.Array:
    """The root's heading [B] (rad), 0 along x."""
    q = quaternion.heading(kinematics.link_quaternion[:, 0])
    return 2.0 * jnp.arctan2(q[:, 3], q[:, 0])


def yaw_ahead(key: jax.Array, kinematics: Kinematics, most: float) -> jax.Array:
    """Random yaws [B] (rad, world) at `most` so far off the root's heading."""
    return root_heading(kinematics) + uniform(key, len(kinematics.finite), (-most, most))


def floor_direction(yaw: jax.Array) -> jax.Array:
    """Unit vectors on the floor [B, 2]."""
    return jnp.stack([jnp.cos(yaw), jnp.sin(yaw)], axis=-1)


def uniform(key: jax.Array, count: int, bounds: tuple[float, float]) -> jax.Array:
    """`count` numbers between two bounds."""
    return jax.random.uniform(key, (count,), minval=bounds[0], maxval=bounds[1])


def no_event(kinematics: Kinematics) -> jax.Array:
    """[B] NaN: no attempt ended."""
    return jnp.full(kinematics.finite.shape, jnp.nan)


def never(kinematics: Kinematics) -> jax.Array:
    """[B] False."""
    return jnp.zeros(kinematics.finite.shape, bool)
