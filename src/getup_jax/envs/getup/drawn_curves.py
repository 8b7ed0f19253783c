"""Curves that an episode follows, and new ones drawn while training from the styles of the library.

A drawn curve is a style blended with another one that starts alike, its inner control points moved
by smooth noise, over another duration:

    points = w a + (1 - w) b + noise,    T = (w T_a + (1 - w) T_b) U(low, high),    w ~ U(1/2, 1)

b is any style whose first torso angles are within `task.curve_match_rad` of those of a, or the
mirror image of one: a itself is among them. a keeps the larger weight, since the start is of a.

A share `curriculum.style_transitions` of them then goes over to a style c that may start otherwise,
by up to `curriculum.transition_rad` (from a side to prone, say), within n of the 8 intervals:

    points_j += clip((j - 1) / n, 0, 1) (c_j - points_j),    n ~ U(1, 5)

The angles that a torso can have, |side - pi/2| + |front - pi/2| <= pi/2, are a convex set: so what
lies between two curves that bodies can follow is a pose, too.

Of lying starts, a share `curriculum.start_at_pose` begins where the body is, x_0, as recordings do,
and curves that people draw for a body that lies there; n is another one:

    points_j += clip(1 - (j - 1) / n, 0, 1) (x_0 - points_0)
"""

from __future__ import annotations

import math
from typing import Protocol

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.config import CurriculumConfig
from getup_jax.envs.getup.episode import LYING
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.getups import FLAT_M

# Rms of a moved control point's height (m), side and front angle (rad), where the noise is 1.
NOISE_RMS = (0.08, math.radians(10.0), math.radians(12.0))
_SMOOTH = (1.0, 2.0, 1.0)  # weights of the draws that a point and its neighbours share
_LEAST_SHARE = 0.5  # of the episode's own style in a blend
_SAMPLES = 65  # of a curve, to see what heights it covers
_RAMP = (1.0, 5.0)  # intervals between control points that such a change takes
_TRANSITION, _POSE = 1, 2  # folded into the key, so that curves without them are what they were


@struct.dataclass
class Curve:
    """The curves of B episodes."""

    points: jax.Array  # [B, 9, 3] control points: height (m), side and front angle (rad)
    duration: jax.Array  # [B] s
    # [B, 9] of the gap between the first point and the start pose, by how much each point moves
    pose_share: jax.Array | None = None

    def from_pose(self, features: jax.Array) -> jax.Array:
        """The control points [B, 9, 3] for bodies that begin with the curve values [B, 3]."""
        if self.pose_share is None:
            return self.points
        gap = features - self.points[:, 0]
        return self.points + self.pose_share[..., None] * gap[:, None]


class Library(Protocol):
    """The part of the task's world that has the styles."""

    @property
    def points(self) -> jax.Array:
        """[G, 9, 3] control points."""
        ...

    @property
    def duration(self) -> jax.Array:
        """[G] s."""
        ...


def style_curve(library: Library, getup: jax.Array) -> Curve:
    """The library's own curves of the styles [B]."""
    return Curve(points=library.points[getup], duration=library.duration[getup])


def draw_curves(
    config: CurriculumConfig,
    match_rad: float,
    library: Library,
    key: jax.Array,
    getup: jax.Array,
    kind: jax.Array,
) -> Curve:
    """Curves for episodes of the styles [B] that start in the kinds [B].

    A share `curriculum.drawn_curves` of them is drawn, the others are the styles as they are.
    """
    key_share, key_blend, key_noise, key_time = jax.random.split(key, 4)
    size = getup.shape[0]
    own = style_curve(library, getup)
    blended = _blended(library, key_blend, getup, match_rad)
    if config.style_transitions > 0:
        key_transition = jax.random.fold_in(key, _TRANSITION)
        blended = _with_transitions(config, library, key_transition, getup, blended)
    moved = config.curve_noise * smooth_noise(key_noise, kind)
    points = _within(blended.points, blended.points + moved, covered_height(library))
    low, high = config.duration_range
    duration = blended.duration * jax.random.uniform(key_time, (size,), minval=low, maxval=high)
    fastest = jnp.max(fastest_rise(library.points, library.duration)) / low
    slow_enough = duration * fastest_rise(points, duration) / fastest
    if config.style_transitions > 0:
        fastest = jnp.max(fastest_turn(library.points, library.duration)) / low
        slow_enough = jnp.maximum(slow_enough, duration * fastest_turn(points, duration) / fastest)
    chance = jax.random.uniform(key_share, (size,))
    drawn = chance < config.drawn_curves
    pose_share = None
    if config.start_at_pose > 0:
        ramp = _ramp(jax.random.fold_in(key, _POSE), config.start_at_pose, size)
        pose_share = jnp.where((drawn & (kind == LYING))[:, None], ramp, 0.0)
    return Curve(
        points=jnp.where(drawn[:, None, None], points, own.points),
        duration=jnp.where(drawn, jnp.maximum(duration, slow_enough), own.duration),
        pose_share=pose_share,
    )


def smooth_noise(key: jax.Array, kind: jax.Array) -> jax.Array:
    """Moves [B, 9, 3] of the control points, with the rms of NOISE_RMS where they are not zero.

    Neighbours move alike (correlation 2/3, 1/6 with the next but one). The first and last points
    stay, and for lying starts the second one, which is the curve's slope there.
    """
    weight = jnp.asarray(_SMOOTH) / math.hypot(*_SMOOTH)
    shape = (kind.shape[0], curves.NUM_POINTS + len(_SMOOTH) - 1, len(NOISE_RMS))
    raw = jax.random.normal(key, shape)
    smooth = sum(w * raw[:, i : i + curves.NUM_POINTS] for i, w in enumerate(weight))
    point = jnp.arange(curves.NUM_POINTS)
    first = jnp.where(kind == LYING, 2, 1)[:, None]
    free = (point >= first) & (point < curves.NUM_POINTS - 1)
    return jnp.where(free[..., None], smooth * jnp.asarray(NOISE_RMS), 0.0)


def fastest_rise(points: jax.Array, duration: jax.Array) -> jax.Array:
    """Bound [...] (m/s) on how fast the height rises: the largest step between two points.

    The slope of a B-spline is a mean of such steps. points [..., 9, 3], duration [...] (s).
    """
    steps = jnp.diff(points[..., 0], axis=-1)
    return jnp.max(steps, axis=-1) * (curves.NUM_POINTS - 1) / duration


def fastest_turn(points: jax.Array, duration: jax.Array) -> jax.Array:
    """The same bound [...] (rad/s) on how fast an angle changes, in either direction."""
    steps = jnp.abs(jnp.diff(points[..., 1:], axis=-2))
    return jnp.max(steps, axis=(-1, -2)) * (curves.NUM_POINTS - 1) / duration


def covered_height(library: Library) -> tuple[jax.Array, jax.Array]:
    """Lowest and highest value (m) of the library's curves, the lowest one off the floor.

    Below FLAT_M the head is on the floor, which ends an episode soon.
    """
    s = jnp.broadcast_to(jnp.linspace(0.0, 1.0, _SAMPLES), (library.points.shape[0], _SAMPLES))
    height = curves.evaluate(library.points[:, None], s)[..., 0]
    return jnp.maximum(jnp.min(height), FLAT_M), jnp.max(height)


def mirrored(points: jax.Array) -> jax.Array:
    """Control points [..., 9, 3] of mirror images: the side angle becomes pi minus itself."""
    return points.at[..., 1].set(jnp.pi - points[..., 1])


def _blended(library: Library, key: jax.Array, getup: jax.Array, match_rad: float) -> Curve:
    """Blends of the styles [B] with partners that start alike, drawn evenly."""
    key_partner, key_weight = jax.random.split(key)
    own = style_curve(library, getup)
    other = _partners(library, key_partner, getup, match_rad)
    weight = jax.random.uniform(key_weight, getup.shape, minval=_LEAST_SHARE)
    return Curve(
        points=_mix(weight[:, None, None], own.points, other.points),
        duration=_mix(weight, own.duration, other.duration),
    )


def _partners(library: Library, key: jax.Array, getup: jax.Array, limit_rad: float) -> Curve:
    """Styles, or their mirror images, whose first angles are near those of the styles [B]."""
    own = library.points[getup]
    points = jnp.concatenate([library.points, mirrored(library.points)])
    duration = jnp.concatenate([library.duration, library.duration])
    gap = jnp.max(jnp.abs(own[:, None, 0, 1:] - points[:, 0, 1:]), axis=-1)
    # counts of the partners so far [B, 2 G]; a style is its own partner, so that there is one
    order = jnp.cumsum(gap <= limit_rad, axis=-1)
    number = jnp.floor(jax.random.uniform(key, getup.shape) * order[:, -1])
    partner = jnp.argmax(order > number[:, None], axis=-1)
    return Curve(points=points[partner], duration=duration[partner])


def _with_transitions(
    config: CurriculumConfig, library: Library, key: jax.Array, getup: jax.Array, begun: Curve
) -> Curve:
    """The curves [B], a share of which goes over to another style after the first two points."""
    key_partner, key_ramp = jax.random.split(key)
    other = _partners(library, key_partner, getup, config.transition_rad)
    own = _ramp(key_ramp, config.style_transitions, len(getup), rest=1.0)
    return Curve(
        points=_mix(own[..., None], begun.points, other.points),
        duration=_mix(jnp.mean(own, axis=-1), begun.duration, other.duration),
    )


def _ramp(key: jax.Array, share: float, size: int, rest: float = 0.0) -> jax.Array:
    """Weights [B, 9] that fall from 1 to 0 after the first two points; `rest` for 1 - share."""
    key_share, key_length = jax.random.split(key)
    low, high = _RAMP
    length = jax.random.uniform(key_length, (size, 1), minval=low, maxval=high)
    falling = jnp.clip(1.0 - (jnp.arange(curves.NUM_POINTS) - 1) / length, 0.0, 1.0)
    return jnp.where(jax.random.uniform(key_share, (size, 1)) < share, falling, rest)


def _mix(weight: jax.Array, a: jax.Array, b: jax.Array) -> jax.Array:
    return weight * a + (1.0 - weight) * b


def _within(before: jax.Array, points: jax.Array, height: tuple[jax.Array, jax.Array]) -> jax.Array:
    """Points [B, 9, 3] that noise moves no further out than what bodies do.

    The height stays in the given range and angles in [0, pi], but for points that were outside
    `before`, which may stay where they were.
    """
    low = jnp.stack([height[0], jnp.zeros(()), jnp.zeros(())])
    high = jnp.stack([height[1], jnp.full((), jnp.pi), jnp.full((), jnp.pi)])
    return jnp.clip(points, jnp.minimum(before, low), jnp.maximum(before, high))
