"""Juggling: a cascade of three balls, caught and released by the rules of the paper [C 6.4].

A flying ball near the free hand that it was thrown to is caught and moves with it. Every hand
lets go at a fixed interval, half of it after the other hand; the ball leaves with the hand's own
velocity, so that the policy does the throwing. The reward's form is not public and our own: a
ball earns 1 while it is held, and less the farther from its hand it will come down.
"""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from getup_jax.config.ranges import number
from getup_jax.core.types import Kinematics, PropCommand
from getup_jax.envs.composite.goals.flight import descent, flown, throw
from getup_jax.envs.composite.goals.goal import GoalOutput, Marker, heading_frame
from getup_jax.physics.props import Ball

LEFT, RIGHT, NONE = 0, 1, -1
_COUNT = 3
_SHARPNESS = 3.0  # 1/m


@struct.dataclass
class JugglingState:
    """Who holds which ball. Hands: LEFT, RIGHT or NONE."""

    frame: jax.Array  # [B] int32, control steps; the left hand lets go in the middle of an interval
    holder: jax.Array  # [B, 3] int32, the hand that holds each ball; NONE: it flies
    catcher: jax.Array  # [B, 3] int32, the hand that each flying ball was thrown to
    leaving: jax.Array  # [B, 3] int32, the hand that each ball leaves right now, else NONE
    fresh: jax.Array  # [B] bool, whether the third ball is thrown right now, to begin with


@dataclasses.dataclass(frozen=True)
class Juggling:
    """Settings of the goal."""

    control_dt: float
    left: int  # link index of the left hand
    right: int
    # control steps between two releases of the same hand
    interval: int = number(20, least=2, most=1000)
    catch_m: float = number(0.12, above=0, most=2)  # a ball as near to its hand is caught
    drop_m: float = number(0.3, least=0, most=2)  # a ball as low is lost, which ends the episode
    # flight of the third ball, which is in the air at the start
    first_throw_s: float = number(0.5, above=0, most=10)

    name: ClassVar[str] = "juggling"
    links: ClassVar[dict[str, str]] = {"left": "hand_l", "right": "hand_r"}
    observation_size: ClassVar[int] = 6 * _COUNT + 2 * _COUNT + 2
    balls: ClassVar[tuple[Ball, ...]] = tuple(
        Ball(f"juggling_{i}", 0.04, 0.1, (0.9, 0.3 + 0.25 * i, 0.2, 1.0)) for i in range(_COUNT)
    )

    def reset(self, key: jax.Array, kinematics: Kinematics) -> JugglingState:
        """A ball in each hand, and one on its way to the hand that will let go first.

        In time with the arms: hands that swing let go where they rise fastest.
        """
        count = len(kinematics.finite)
        frame = self._in_time(kinematics)
        first = jnp.where(frame < self.interval // 2, LEFT, RIGHT)

        def everywhere(*hands: jax.Array | int) -> jax.Array:
            return jnp.stack([jnp.full(count, x, jnp.int32) for x in hands], axis=1)

        return JugglingState(
            frame=frame,
            holder=everywhere(LEFT, RIGHT, NONE),
            catcher=everywhere(RIGHT, LEFT, first),
            leaving=everywhere(NONE, NONE, 1 - first),
            fresh=jnp.ones(count, bool),
        )

    def step(
        self, key: jax.Array, state: JugglingState, kinematics: Kinematics
    ) -> tuple[JugglingState, GoalOutput]:
        """Catch, reward, then release."""
        distance = self._distance(kinematics)  # [B, Q, 2]
        frame = state.frame + 1
        free = ~jnp.any(state.holder[..., None] == jnp.arange(2), axis=1)  # [B, 2]
        flying = state.holder == NONE
        mine = flying[..., None] & (state.catcher[..., None] == jnp.arange(2))
        nearest = distance == jnp.min(jnp.where(mine, distance, jnp.inf), axis=1, keepdims=True)
        near = distance < self.catch_m
        caught = jnp.any(mine & free[:, None] & near & nearest, axis=2)  # [B, Q]
        holder = jnp.where(caught, state.catcher, state.holder)
        lost = jnp.any((holder == NONE) & self._low(kinematics), axis=1)
        output = GoalOutput(
            reward=self._reward(holder, state.catcher, kinematics),
            terminated=lost,
            success=jnp.where(lost, 0.0, jnp.where(jnp.any(caught, axis=1), 1.0, jnp.nan)),
        )
        release = jnp.where(holder == NONE, False, holder == self._releasing(frame)[:, None])
        return JugglingState(
            frame=frame,
            holder=jnp.where(release, NONE, holder),
            catcher=jnp.where(release, 1 - holder, state.catcher),
            leaving=jnp.where(release, holder, NONE),
            fresh=jnp.zeros_like(state.fresh),
        ), output

    def toward(
        self, state: JugglingState, kinematics: Kinematics, bearing: jax.Array
    ) -> JugglingState:
        """No direction on the floor."""
        return state

    def observe(self, state: JugglingState, kinematics: Kinematics) -> jax.Array:
        """Balls from the root 9, their velocities 9, holders 6, time to the releases 2."""
        command = self.command(state, kinematics)
        at = command.mask[..., None]
        position = jnp.where(at, command.position, self._position(kinematics))
        velocity = jnp.where(at, command.velocity, self._velocity(kinematics))
        position = position - kinematics.link_position[:, :1]
        blocks = [
            heading_frame(kinematics, v[:, i]) for v in (position, velocity) for i in range(3)
        ]
        held = (state.holder[..., None] == jnp.arange(2)).astype(jnp.float32)
        blocks.append(held.reshape(len(held), -1))
        first = jnp.asarray([self.interval // 2, 0])  # the left hand is the first
        blocks.append(jnp.mod(first - state.frame[:, None], self.interval) / self.interval)
        return jnp.concatenate(blocks, axis=-1)

    def command(self, state: JugglingState, kinematics: Kinematics) -> PropCommand:
        """Held balls go with their hand; a ball that leaves takes its velocity.

        The ball that is in the air at the start comes to where a body that goes on has the hand.
        """
        hand = jnp.where(state.holder == NONE, state.leaving, state.holder)  # [B, Q]
        place = self._of_hands(kinematics.link_position)
        motion = self._of_hands(kinematics.link_linear_velocity)
        index = jnp.maximum(hand, 0)[..., None]
        position = jnp.take_along_axis(place, index, axis=1)
        velocity = jnp.take_along_axis(motion, index, axis=1)
        goal = jnp.take_along_axis(place, state.catcher[:, 2:, None], axis=1)[:, 0]
        thrown = throw(position[:, 2], goal, self.first_throw_s) + _walk(kinematics)
        last = jnp.where(state.fresh[:, None], thrown, velocity[:, 2])
        velocity = velocity.at[:, 2].set(last)
        return PropCommand(mask=hand != NONE, position=position, velocity=velocity)

    def markers(self, state: JugglingState, kinematics: Kinematics) -> list[Marker]:
        """A halo around the hand that must catch next."""
        hands = {LEFT: self.left, RIGHT: self.right}
        flying = np.asarray(state.holder) == NONE
        wanted = {int(hand) for hand in np.asarray(state.catcher)[flying]}
        places = [np.asarray(kinematics.link_position[hands[hand]]) for hand in sorted(wanted)]
        return [Marker(position=p, radius=self.catch_m, rgba=(0.2, 0.8, 0.2, 0.3)) for p in places]

    def steer(self, state: JugglingState, order: dict[str, Any], age_s: float) -> JugglingState:
        """There is nothing to set: no `orders`."""
        return state

    def _releasing(self, frame: jax.Array) -> jax.Array:
        """The hand that lets go in this control step, [B]; NONE in most."""
        beat = self.interval // 2
        hand = jnp.where((frame // beat) % 2 == 1, LEFT, RIGHT)
        return jnp.where(frame % beat == 0, hand, NONE)

    def _in_time(self, kinematics: Kinematics) -> jax.Array:
        """The control step [B] of an interval at which the hands are.

        With d = left - right height as a sine of the interval's period: d = 0, rising, is the step
        at which the left hand lets go.
        """
        high = self._of_hands(kinematics.link_position)[..., 2]
        rate = self._of_hands(kinematics.link_linear_velocity)[..., 2]
        period = self.interval * self.control_dt
        d, d_rate = high[:, 0] - high[:, 1], rate[:, 0] - rate[:, 1]
        turn = jnp.arctan2(2.0 * jnp.pi / period * d, d_rate) / (2.0 * jnp.pi)
        frame = jnp.round(self.interval * (0.5 + turn)).astype(jnp.int32)
        return jnp.mod(frame, self.interval)

    def _reward(self, holder: jax.Array, catcher: jax.Array, kinematics: Kinematics) -> jax.Array:
        """Mean over the balls [B]: 1 in a hand, exp(-3 d) for one that misses its hand by d (m).

        d is taken when the ball comes down to the hand's height, had the hand only walked on with
        the body: a throw is judged when the ball leaves, and a hand when it goes to meet the ball.
        """
        position, velocity = self._position(kinematics), self._velocity(kinematics)
        index = catcher[..., None]
        hand = jnp.take_along_axis(self._of_hands(kinematics.link_position), index, axis=1)
        time = descent(position, velocity, hand[..., 2])
        hand = hand + _walk(kinematics)[:, None] * time[..., None]
        miss = jnp.linalg.norm(flown(position, velocity, time) - hand, axis=-1)  # [B, Q]
        return jnp.mean(jnp.where(holder == NONE, jnp.exp(-_SHARPNESS * miss), 1.0), axis=1)

    def _distance(self, kinematics: Kinematics) -> jax.Array:
        """From every ball to both hands, [B, Q, 2] (m)."""
        hands = self._of_hands(kinematics.link_position)
        return jnp.linalg.norm(self._position(kinematics)[:, :, None] - hands[:, None], axis=-1)

    def _low(self, kinematics: Kinematics) -> jax.Array:
        return self._position(kinematics)[..., 2] < self.drop_m

    def _of_hands(self, links: jax.Array) -> jax.Array:
        return links[:, jnp.asarray([self.left, self.right])]

    def _position(self, kinematics: Kinematics) -> jax.Array:
        assert kinematics.prop_position is not None, "the character must be loaded with the balls"
        return kinematics.prop_position

    def _velocity(self, kinematics: Kinematics) -> jax.Array:
        assert kinematics.prop_velocity is not None, "the character must be loaded with the balls"
        return kinematics.prop_velocity


def _walk(kinematics: Kinematics) -> jax.Array:
    """Velocity of the root over the floor, [B, 3] (m/s)."""
    return kinematics.link_linear_velocity[:, 0] * jnp.array([1.0, 1.0, 0.0])
