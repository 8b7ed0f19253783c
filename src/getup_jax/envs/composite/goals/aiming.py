"""Aiming: point the right forearm along a direction [C 6.4, reward of its release]."""

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
    heading_frame,
    never,
    no_event,
    uniform,
    yaw_ahead,
)
from getup_jax.physics.props import Ball

_SHARPNESS = 2.0


@struct.dataclass
class AimingState:
    """Where to point, and for how long."""

    direction: jax.Array  # [B, 3] unit vector, world
    time_left: jax.Array  # [B] s


@dataclasses.dataclass(frozen=True)
class Aiming:
    """Settings of the goal."""

    control_dt: float
    forearm: int  # link index
    hand: int  # link index
    # rad, the largest angle of a new direction to the character's heading
    yaw: float = number(0.8, least=0, most=math.pi)
    # rad above the horizontal
    pitch: tuple[float, float] = number((-0.3, 0.4), least=-math.pi / 2, most=math.pi / 2, length=2)
    time: tuple[float, float] = number((2.0, 4.0), above=0, most=600, length=2)  # s between changes

    name: ClassVar[str] = "aiming"
    links: ClassVar[dict[str, str]] = {"forearm": "forearm_r", "hand": "hand_r"}
    observation_size: ClassVar[int] = 3
    balls: ClassVar[tuple[Ball, ...]] = ()
    orders: ClassVar[dict[str, tuple[int, Any]]] = {"yaw_deg": (1, REQUIRED), "pitch_deg": (1, 0.0)}

    def reset(self, key: jax.Array, kinematics: Kinematics) -> AimingState:
        """A direction around where the character faces."""
        key_yaw, key_pitch, key_time = jax.random.split(key, 3)
        count = len(kinematics.finite)
        level = floor_direction(yaw_ahead(key_yaw, kinematics, self.yaw))
        pitch = uniform(key_pitch, count, self.pitch)
        direction = [level * jnp.cos(pitch)[:, None], jnp.sin(pitch)[:, None]]
        return AimingState(
            direction=jnp.concatenate(direction, axis=-1),
            time_left=uniform(key_time, count, self.time),
        )

    def step(
        self, key: jax.Array, state: AimingState, kinematics: Kinematics
    ) -> tuple[AimingState, GoalOutput]:
        """Reward of the forearm's direction; a new one where the time is over."""
        elbow = kinematics.link_position[:, self.forearm]
        hand = kinematics.link_position[:, self.hand]
        reward = aiming_reward(elbow, hand, state.direction)
        state = state.replace(time_left=state.time_left - self.control_dt)
        state = select(state.time_left <= 0.0, self.reset(key, kinematics), state)
        return state, GoalOutput(reward, never(kinematics), no_event(kinematics))

    def toward(self, state: AimingState, kinematics: Kinematics, bearing: jax.Array) -> AimingState:
        """No direction on the floor."""
        return state

    def observe(self, state: AimingState, kinematics: Kinematics) -> jax.Array:
        """The direction in the heading frame 3."""
        return heading_frame(kinematics, state.direction)

    def command(self, state: AimingState, kinematics: Kinematics) -> PropCommand | None:
        """No balls."""
        return None

    def markers(self, state: AimingState, kinematics: Kinematics) -> list[Marker]:
        """An arrow from the elbow."""
        elbow = np.asarray(kinematics.link_position[self.forearm])
        return [Marker(position=elbow, reach=np.asarray(state.direction), radius=0.015)]

    def steer(self, state: AimingState, order: dict[str, Any], age_s: float) -> AimingState:
        """Point along `yaw_deg` (world, 0 along x), `pitch_deg` above the horizontal."""
        yaw, pitch = (jnp.radians(jnp.float32(order[key])) for key in ("yaw_deg", "pitch_deg"))
        level = jnp.cos(pitch)
        direction = jnp.stack([level * jnp.cos(yaw), level * jnp.sin(yaw), jnp.sin(pitch)])
        return AimingState(direction[None], jnp.full(1, HELD_S, jnp.float32))


def aiming_reward(elbow: jax.Array, hand: jax.Array, direction: jax.Array) -> jax.Array:
    """exp(-2 |hand - (elbow + L u)| / L) with L the forearm's length; positions [B, 3]."""
    length = jnp.linalg.norm(hand - elbow, axis=-1)
    gap = jnp.linalg.norm(hand - (elbow + length[:, None] * direction), axis=-1)
    return jnp.exp(-_SHARPNESS * gap / jnp.maximum(length, 1e-6))
