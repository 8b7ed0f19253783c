"""Tennis swing: hit a ball that comes to the forehand, fast and to a place [C 6.4].

The reward looks at the outgoing ball's speed and destination only. The paper's appendix with
their form is not public: here both are bell-shaped, and their product is paid from the hit to the
next ball, so that it does not depend on how long the ball flies.
"""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from getup_jax.config.ranges import number
from getup_jax.core import quaternion
from getup_jax.core.types import Kinematics, PropCommand, select
from getup_jax.envs.composite.goals.flight import kick, landing, throw
from getup_jax.envs.composite.goals.goal import (
    REQUIRED,
    GoalOutput,
    Marker,
    floor_frame,
    heading_frame,
    never,
    uniform,
)
from getup_jax.physics.props import RACKET_CENTRE_M, Ball

_COMING, _TOUCHED, _OUT = 0, 1, 2  # what the ball has done
_KICK_MPS = 1.0  # a change of velocity by more is a hit
_NEAR_M = 0.4  # from the racket's centre; farther away it was something else
_FAR_M = 10.0  # unit of the destination that the policy sees


@struct.dataclass
class TennisState:
    """The ball in play."""

    time_left: jax.Array  # [B] s, to the next ball
    fresh: jax.Array  # [B] bool, the ball has still to be put at its start
    start: jax.Array  # [B, 3] m, world
    launch: jax.Array  # [B, 3] m/s
    goal: jax.Array  # [B, 2] m, where on the floor the ball should land
    velocity: jax.Array  # [B, 3] m/s, the ball's after the last control step
    stage: jax.Array  # [B] int32: coming, touched, out
    score: jax.Array  # [B] of the hit


@dataclasses.dataclass(frozen=True)
class TennisSwing:
    """Settings of the goal."""

    control_dt: float
    hand: int  # link index
    period: tuple[float, float] = number((2.0, 2.5), above=0, most=600, length=2)  # s between balls
    flight_s: float = number(0.9, above=0, most=10)  # from the launch to the character
    from_m: float = number(4.0, above=0, most=100)  # how far in front of the character balls start
    # m from the root, where they come to
    forward: tuple[float, float] = number((0.2, 0.6), least=-10, most=10, length=2)
    right: tuple[float, float] = number((0.6, 1.0), least=-10, most=10, length=2)  # m
    height: tuple[float, float] = number((0.7, 1.1), least=0, most=10, length=2)  # m
    speed_mps: float = number(10.0, above=0, most=100)  # outgoing speed that earns all
    # in front of the character, where balls should land
    depth_m: float = number(9.0, above=0, most=100)
    width_m: float = number(2.0, least=0, most=100)  # to either side of it
    spread_m: float = number(4.0, above=0, most=100)  # miss that costs a factor of e

    name: ClassVar[str] = "tennis_swing"
    links: ClassVar[dict[str, str]] = {"hand": "hand_r"}
    racket: ClassVar[bool] = True
    observation_size: ClassVar[int] = 10
    orders: ClassVar[dict[str, tuple[int, Any]]] = {"land": (2, REQUIRED)}
    balls: ClassVar[tuple[Ball, ...]] = (Ball("tennis_ball", 0.04, 0.058),)

    def reset(self, key: jax.Array, kinematics: Kinematics) -> TennisState:
        """A new ball from the front to the character's right."""
        keys = jax.random.split(key, 5)
        count = len(kinematics.finite)
        heading = quaternion.heading(kinematics.link_quaternion[:, 0])
        floor = kinematics.link_position[:, 0] * jnp.asarray([1.0, 1.0, 0.0])

        def place(forward: jax.Array, left: jax.Array, height: jax.Array) -> jax.Array:
            offset = jnp.stack([forward, left, height], axis=-1)
            return floor + quaternion.rotate(heading, offset)

        full = jnp.ones(count)
        height, right = uniform(keys[0], count, self.height), uniform(keys[1], count, self.right)
        end = place(uniform(keys[2], count, self.forward), -right, height)
        start = place(self.from_m * full, -right, full)
        aside = uniform(keys[3], count, (-self.width_m, self.width_m))
        launch = throw(start, end, self.flight_s)
        return TennisState(
            time_left=uniform(keys[4], count, self.period),
            fresh=jnp.ones(count, bool),
            start=start,
            launch=launch,
            goal=place(self.depth_m * full, aside, 0.0 * full)[:, :2],
            velocity=launch,
            stage=jnp.full(count, _COMING, jnp.int32),
            score=jnp.zeros(count),
        )

    def step(
        self, key: jax.Array, state: TennisState, kinematics: Kinematics
    ) -> tuple[TennisState, GoalOutput]:
        """See whether the ball is hit; where the time is over a new one comes."""
        position, velocity = self._ball(kinematics)
        # the bounce may end in the next control step, so the score is taken one later
        leaves = state.stage == _TOUCHED
        score = jnp.where(leaves, self.score(position, velocity, state.goal), state.score)
        touched = (state.stage == _COMING) & self._is_hit(state, kinematics)
        stage = jnp.where(leaves, _OUT, jnp.where(touched, _TOUCHED, state.stage))
        state = state.replace(
            time_left=state.time_left - self.control_dt,
            fresh=jnp.zeros_like(state.fresh),
            velocity=velocity,
            stage=stage,
            score=score,
        )
        over = state.time_left <= 0.0
        success = jnp.where(over, (stage != _COMING).astype(jnp.float32), jnp.nan)
        output = GoalOutput(score, never(kinematics), success)
        return select(over, self.reset(key, kinematics), state), output

    def score(self, position: jax.Array, velocity: jax.Array, goal: jax.Array) -> jax.Array:
        """Speed term times destination term [B] of a ball that leaves the racket."""
        speed = jnp.linalg.norm(velocity, axis=-1)
        lack = jnp.maximum(self.speed_mps - speed, 0.0) / self.speed_mps
        miss = jnp.linalg.norm(landing(position, velocity) - goal, axis=-1) / self.spread_m
        return jnp.exp(-3.0 * jnp.square(lack)) * jnp.exp(-jnp.square(miss))

    def toward(self, state: TennisState, kinematics: Kinematics, bearing: jax.Array) -> TennisState:
        """No direction on the floor."""
        return state

    def observe(self, state: TennisState, kinematics: Kinematics) -> jax.Array:
        """Ball from the root 3, its velocity 3, destination 2, time to the next 1, still due 1."""
        position, velocity = self._ball(kinematics)
        fresh = state.fresh[:, None]
        position = jnp.where(fresh, state.start, position) - kinematics.link_position[:, 0]
        velocity = jnp.where(fresh, state.launch, velocity)
        goal = floor_frame(kinematics, state.goal - kinematics.link_position[:, 0, :2]) / _FAR_M
        due = (state.stage == _COMING).astype(jnp.float32)
        blocks = [heading_frame(kinematics, position), heading_frame(kinematics, velocity), goal]
        return jnp.concatenate([*blocks, state.time_left[:, None], due[:, None]], axis=-1)

    def command(self, state: TennisState, kinematics: Kinematics) -> PropCommand:
        """Put a new ball at its start; otherwise physics moves it."""
        return PropCommand(
            mask=state.fresh[:, None], position=state.start[:, None], velocity=state.launch[:, None]
        )

    def markers(self, state: TennisState, kinematics: Kinematics) -> list[Marker]:
        """Where the ball should land."""
        return [Marker(position=np.append(np.asarray(state.goal), 0.0), radius=0.3)]

    def steer(self, state: TennisState, order: dict[str, Any], age_s: float) -> TennisState:
        """Balls should land at `land` (m, world)."""
        return state.replace(goal=jnp.asarray([order["land"]], jnp.float32))

    def _is_hit(self, state: TennisState, kinematics: Kinematics) -> jax.Array:
        """Whether [B] something near the racket has changed the ball's velocity."""
        position, velocity = self._ball(kinematics)
        turn = kinematics.link_quaternion[:, self.hand]
        arm = quaternion.rotate(
            turn, jnp.broadcast_to(jnp.asarray(RACKET_CENTRE_M), turn[:, 1:].shape)
        )
        racket = kinematics.link_position[:, self.hand] + arm
        near = jnp.linalg.norm(position - racket, axis=-1) < _NEAR_M
        before = jnp.where(state.fresh[:, None], state.launch, state.velocity)
        return near & (kick(before, velocity, self.control_dt) > _KICK_MPS)

    def _ball(self, kinematics: Kinematics) -> tuple[jax.Array, jax.Array]:
        position, velocity = kinematics.prop_position, kinematics.prop_velocity
        assert position is not None, "the character must be loaded with the ball"
        assert velocity is not None, "the character must be loaded with the ball"
        return position[:, 0], velocity[:, 0]
