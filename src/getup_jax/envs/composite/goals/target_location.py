"""Target location: be at a place on the floor within a time [C 6.4, numbers of its release]."""

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
    root_heading,
    uniform,
    yaw_ahead,
)
from getup_jax.envs.composite.goals.speed import velocity_reward
from getup_jax.physics.props import Ball

_FAR_M, _FAR_MOST = 3.0, 1.5  # the distance that the policy sees: in units of 3 m, at most 1.5
_LEAST_TIME_S = 1e-3


@struct.dataclass
class LocationState:
    """Where to be, and when."""

    place: jax.Array  # [B, 2] m, world
    time_left: jax.Array  # [B] s
    reached: jax.Array  # [B] bool, whether the root has been within the radius


@dataclasses.dataclass(frozen=True)
class TargetLocation:
    """Settings of the goal."""

    control_dt: float
    # m/s; walking. Running: 2, 4
    speed: tuple[float, float] = number((1.2, 1.5), above=0, most=20, length=2)
    # s to get there; the distance is a drawn speed times it
    time: tuple[float, float] = number((3.0, 5.0), above=0, most=600, length=2)
    # the time is so many times what the distance takes at the drawn speed
    slack: float = number(1.0, above=0, most=100)
    # rad, the largest angle between the heading and the target
    turn: float = number(math.pi, least=0, most=math.pi)
    radius_m: float = number(0.5, above=0, most=100)  # within it the target is reached

    name: ClassVar[str] = "target_location"
    observation_size: ClassVar[int] = 4
    balls: ClassVar[tuple[Ball, ...]] = ()
    orders: ClassVar[dict[str, tuple[int, Any]]] = {"place": (2, REQUIRED), "within_s": (1, 4.0)}

    def reset(self, key: jax.Array, kinematics: Kinematics) -> LocationState:
        """A place that can be reached in time at a speed of the range, and sooner with slack."""
        key_turn, key_speed, key_time = jax.random.split(key, 3)
        count = len(kinematics.finite)
        direction = floor_direction(yaw_ahead(key_turn, kinematics, self.turn))
        time = uniform(key_time, count, self.time)
        distance = time * uniform(key_speed, count, self.speed) / self.slack
        return LocationState(
            place=kinematics.link_position[:, 0, :2] + direction * distance[:, None],
            time_left=time,
            reached=jnp.zeros(count, bool),
        )

    def step(
        self, key: jax.Array, state: LocationState, kinematics: Kinematics
    ) -> tuple[LocationState, GoalOutput]:
        """Reward of the velocity; a new place where the time is over."""
        direction, distance = self._way(state, kinematics)
        inside = distance < self.radius_m
        state = state.replace(
            time_left=state.time_left - self.control_dt, reached=state.reached | inside
        )
        speed = jnp.clip(distance / self._time(state), self.speed[0], self.speed[1])
        velocity = kinematics.link_linear_velocity[:, 0, :2]
        reward = jnp.where(inside, 1.0, velocity_reward(velocity, direction * speed[:, None]))
        over = state.time_left <= 0.0
        success = jnp.where(over, state.reached.astype(jnp.float32), jnp.nan)
        state = select(over, self.reset(key, kinematics), state)
        return state, GoalOutput(reward, never(kinematics), success)

    def toward(
        self, state: LocationState, kinematics: Kinematics, bearing: jax.Array
    ) -> LocationState:
        """Be as far away as before, at the bearing."""
        _, distance = self._way(state, kinematics)
        direction = floor_direction(root_heading(kinematics) + bearing)
        root = kinematics.link_position[:, 0, :2]
        return state.replace(place=root + direction * distance[:, None])

    def observe(self, state: LocationState, kinematics: Kinematics) -> jax.Array:
        """Direction in the heading frame 2, speed that arrives in time 1, distance 1."""
        direction, distance = self._way(state, kinematics)
        speed = jnp.minimum(distance / self._time(state), self.speed[1])
        far = jnp.minimum(distance / _FAR_M, _FAR_MOST)
        blocks = [floor_frame(kinematics, direction), speed[:, None], far[:, None]]
        return jnp.concatenate(blocks, axis=-1)

    def command(self, state: LocationState, kinematics: Kinematics) -> PropCommand | None:
        """No balls."""
        return None

    def markers(self, state: LocationState, kinematics: Kinematics) -> list[Marker]:
        """A ball on the floor, green once it has been reached."""
        place = np.append(np.asarray(state.place), 0.0)
        colour = (0.2, 0.8, 0.2, 0.8) if bool(state.reached) else (0.9, 0.2, 0.2, 0.8)
        return [Marker(position=place, radius=0.12, rgba=colour)]

    def steer(self, state: LocationState, order: dict[str, Any], age_s: float) -> LocationState:
        """Be at `place` (m, world) `within_s` from the order on; it stays the target after that."""
        return state.replace(
            place=jnp.asarray([order["place"]], jnp.float32),
            time_left=jnp.full(1, max(order["within_s"] - age_s, HELD_S), jnp.float32),
            reached=state.reached & (age_s > 0),
        )

    def _way(self, state: LocationState, kinematics: Kinematics) -> tuple[jax.Array, jax.Array]:
        """Unit vector [B, 2] (world) and distance [B] (m) from the root to the place."""
        gap = state.place - kinematics.link_position[:, 0, :2]
        distance = jnp.linalg.norm(gap, axis=-1)
        return gap / jnp.maximum(distance, 1e-6)[:, None], distance

    def _time(self, state: LocationState) -> jax.Array:
        return jnp.maximum(state.time_left, _LEAST_TIME_S)
