"""An assistive wrench on the pelvis while training, which fades where starts succeed with it.

It lifts like a rope while the neck is below the curve, and turns the pelvis towards the curve's
torso angles, so that it needs no more than the curve. On a slope it also turns a body that lies or
sits with its legs up the slope, until they are across it: as it lies it hardly ever gets up. What
it may give at most is a share of the full wrench, its level; every cell of
`start_prioritisation.py` has its own. A level falls with each success of an episode that started
there with the wrench, and rises with each failure, so that a third of them succeed until it is gone
(compare Yu et al. 2018, Learning symmetric and low-energy locomotion). Starts with it are drawn at
a frontier of their own, that of 1 - level: with it a whole rise is learned before its parts are
without. An evaluation has none.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from getup_jax.core import device_axis
from getup_jax.core.types import Kinematics
from getup_jax.motion.getup.curves import FeatureLinks, torso_axes

_FULL_AT_M = 0.15  # below the curve, where the lift is at its most
_FULL_AT_RAD = 0.5  # off the curve's angles, where the turn is at its most
_TURN_NM_PER_N = 0.25  # m, the most turn for the most lift
_ACROSS_RAD = 1.2  # between the legs and down the slope, up to which their direction is left alone
_STEEP = 0.2  # sine of the slope from which on they are turned at full strength
_UP_M = 0.8, 0.6  # heights of the neck at which that begins and is at its most
_SUCCESS, _FAILURE = 0.02, 0.01  # by which they lower and raise a level
_DAMPING_S = 0.05  # rad of error that an angular velocity of 1 rad/s counts as


def wrench(
    links: FeatureLinks,
    kinematics: Kinematics,
    features: jax.Array,
    target: jax.Array,
    normal: jax.Array,
    most: jax.Array,
) -> jax.Array:
    """Force (N) and torque (Nm) [B, 6] on the root, world frame.

    features and target [B, 3]: measured, and on the curve; normal [B, 3]: of the ground below the
    root; most [B]: the most lift (N).

        f_z = most clip((p_h - h) / .15, 0, 1)
        m = .25 most clip_norm((sum_i (theta_i - p_i) n_i + psi z - .05 w) / .5, 1)

    n_i = (a_i x z) / |a_i x z| turns the torso's side or front vector a_i up, which makes its angle
    theta_i smaller; psi is that of `_legs_up_the_slope`; w is the root's angular velocity (rad/s).
    """
    error = features - target
    lift = most * jnp.clip(-error[:, 0] / _FULL_AT_M, 0.0, 1.0)
    axes = torso_axes(links, kinematics.link_position)  # [B, 2, 3]
    up = jnp.asarray([0.0, 0.0, 1.0])
    turn_axis = jnp.cross(axes, up)
    length = jnp.linalg.norm(turn_axis, axis=-1, keepdims=True)
    turn_axis = turn_axis / jnp.maximum(length, 0.1)  # fades where every way is up
    spin = kinematics.link_angular_velocity[:, links.root]
    turn = jnp.sum(error[:, 1:, None] * turn_axis, axis=1) - _DAMPING_S * spin
    turn += _legs_up_the_slope(axes, features[:, 0], normal)[:, None] * up
    share = turn / _FULL_AT_RAD
    share = share / jnp.maximum(jnp.linalg.norm(share, axis=-1, keepdims=True), 1.0)
    torque = _TURN_NM_PER_N * most[:, None] * share
    return jnp.concatenate([lift[:, None] * up, torque], axis=-1)


def _legs_up_the_slope(axes: jax.Array, height: jax.Array, normal: jax.Array) -> jax.Array:
    """Angle psi [B] (rad) about z by which the legs must turn to lie across the slope; 0: they do.

    axes [B, 2, 3]: the torso's side and front vector; height [B] of the neck. The legs of a body
    that lies point away from its neck, and those of one that sits to its front.
    """
    side, front = axes[:, 0], axes[:, 1]
    legs = (front - jnp.cross(side, front))[:, :2]
    down = normal[:, :2]
    cross = legs[:, 0] * down[:, 1] - legs[:, 1] * down[:, 0]
    angle = jnp.arctan2(cross, jnp.sum(legs * down, axis=-1))
    too_far = jnp.sign(angle) * jnp.maximum(jnp.abs(angle) - _ACROSS_RAD, 0.0)
    steep = jnp.minimum(jnp.linalg.norm(down, axis=-1) / _STEEP, 1.0)
    begins, most = _UP_M
    return too_far * steep * jnp.clip((begins - height) / (begins - most), 0.0, 1.0)


def update(
    level: jax.Array,
    cell: tuple[jax.Array, ...],
    ended: jax.Array,
    success: jax.Array,
) -> jax.Array:
    """The levels after episodes [B] with the wrench that ended; cell holds their indices [B]."""
    change = jnp.where(success, -_SUCCESS, _FAILURE) * ended
    return jnp.clip(device_axis.added(level, cell, change), 0.0, 1.0)
