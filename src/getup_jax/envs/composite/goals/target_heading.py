"""Target heading: go along a direction at a speed, both of which change now and then [C 6.4].

The paper's appendix with the details is not public; this follows its target location.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from getup_jax.config.ranges import number
from getup_jax.core.types import Kinematics, PropCommand, select
from getup_jax.envs.composite.goals.goal import (
    HELD_S,
    REQUIRED,
    GoalOutput,
    Marker,
    floor_direction,
    floor_frame,
    never,
    no_event,
    root_heading,
    uniform,
    yaw_ahead,
)
from getup_jax.envs.composite.goals.speed import velocity_reward
from getup_jax.physics.props import Ball


@struct.dataclass
class HeadingState:
    """What to do now, and for how long."""

    direction: jax.Array  # [B, 2] unit vector on the floor
    speed: jax.Array  # [B] m/s
    time_left: jax.Array  # [B] s


@dataclasses.dataclass(frozen=True)
class TargetHeading:
    """Settings of the goal."""

    control_dt: float
    # m/s, range that targets are drawn from
    speed: tuple[float, float] = number((1.2, 1.5), least=0, most=20, length=2)
    time: tuple[float, float] = number((3.0, 5.0), above=0, most=600, length=2)  # s between changes
    # rad, the largest turn of a new direction off the character's heading
    turn: float = number(2.0, least=0, most=math.pi)

    name: ClassVar[str] = "target_heading"
    observation_size: ClassVar[int] = 3
    balls: ClassVar[tuple[Ball, ...]] = ()
    orders: ClassVar[dict[str, tuple[int, Any]]] = {"yaw_deg": (1, REQUIRED), "speed": (1, None)}

    def reset(self, key: jax.Array, kinematics: Kinematics) -> HeadingState:
        """A direction off the heading that the character has."""
        key_turn, key_speed, key_time = jax.random.split(key, 3)
        count = len(kinematics.finite)
        return HeadingState(
            direction=floor_direction(yaw_ahead(key_turn, kinematics, self.turn)),
            speed=uniform(key_speed, count, self.speed),
            time_left=uniform(key_time, count, self.time),
        )

    def step(
        self, key: jax.Array, state: HeadingState, kinematics: Kinematics
    ) -> tuple[HeadingState, GoalOutput]:
        """Reward of the velocity; a new direction where the time is over."""
        velocity = kinematics.link_linear_velocity[:, 0, :2]
        reward = velocity_reward(velocity, state.direction * state.speed[:, None])
        state = state.replace(time_left=state.time_left - self.control_dt)
        state = select(state.time_left <= 0.0, self.reset(key, kinematics), state)
        return state, GoalOutput(reward, never(kinematics), no_event(kinematics))

    def toward(
        self, state: HeadingState, kinematics: Kinematics, bearing: jax.Array
    ) -> HeadingState:
        """Go along the bearing, at the same speed."""
        return state.replace(direction=floor_direction(root_heading(kinematics) + bearing))

    def observe(self, state: HeadingState, kinematics: Kinematics) -> jax.Array:
        """Direction in the heading frame 2, speed 1."""
        direction = floor_frame(kinematics, state.direction)
        return jnp.concatenate([direction, state.speed[:, None]], axis=-1)

    def command(self, state: HeadingState, kinematics: Kinematics) -> PropCommand | None:
        """No balls."""
        return None

    def markers(self, state: HeadingState, kinematics: Kinematics) -> list[Marker]:
        """An arrow at the feet."""
        root = np.asarray(kinematics.link_position[0])
        reach = np.append(np.asarray(state.direction * state.speed), 0.0)
        return [Marker(position=np.array([root[0], root[1], 0.05]), reach=reach, radius=0.03)]

    def steer(self, state: HeadingState, order: dict[str, Any], age_s: float) -> HeadingState:
        """Go along `yaw_deg` (world, 0 along x) at `speed` (m/s; None: the range's middle)."""
        speed = sum(self.speed) / 2 if order["speed"] is None else order["speed"]
        return HeadingState(
            direction=floor_direction(jnp.radians(jnp.full(1, order["yaw_deg"], jnp.float32))),
            speed=jnp.full(1, speed, jnp.float32),
            time_left=jnp.full(1, HELD_S, jnp.float32),
        )
