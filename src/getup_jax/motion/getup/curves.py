"""Style curves: uniform cubic B-splines with nine control points a feature, and the features.

[P 4.1] asks for a cardinal (uniform-knot) cubic B-spline whose nine control points may be
samples at nine equal steps of time. Phantom points p_-1 = 2 p_0 - p_1 and p_9 = 2 p_8 - p_7
extend the ends, so that the curve starts and ends exactly at its first and last point. The features
that curves control [P 4.2] are a height and two torso angles.
"""

from __future__ import annotations

import dataclasses
from typing import TypeVar

import jax
import numpy as np

from getup_jax.core.types import array_module
from getup_jax.physics.character import CharacterSpec

A = TypeVar("A", bound=jax.Array | np.ndarray)
NUM_POINTS = 9
NAMES = ("height", "side_angle", "front_angle")


def evaluate(points: A, s: A) -> A:
    """Curve values at phase s, in NumPy where both are NumPy's.

    points [..., 9, D] and s [...] in [0, 1] (clipped) with equal leading axes; returns
    [..., D]. Equation 1's min((t - t0) / T, 1) is this clip.
    """
    return array_module(points, s).einsum("...n,...nd->...d", basis(s), points)


def basis(s: A) -> A:
    """Weights [..., 9] of the control points at phase s [...]."""
    xp = array_module(s)
    u = xp.clip(s, 0.0, 1.0) * (NUM_POINTS - 1)
    distance = u[..., None] - xp.arange(-1, NUM_POINTS + 1)
    weight = _bspline(distance)
    return _fold_phantoms(weight)


def _bspline(x: A) -> A:
    """The centred uniform cubic B-spline, non-zero for |x| < 2."""
    xp = array_module(x)
    x = xp.abs(x)
    near = 2.0 / 3.0 - x**2 + x**3 / 2.0
    far = (2.0 - x) ** 3 / 6.0
    return xp.where(x < 1.0, near, xp.where(x < 2.0, far, 0.0))


def _fold_phantoms(weight: A) -> A:
    """Give the two phantom points' weights [..., 11] to the points that define them."""
    xp = array_module(weight)
    first, inner, last = weight[..., :1], weight[..., 1:-1], weight[..., -1:]
    zeros = xp.zeros_like(inner[..., :-2])
    return (
        inner
        + xp.concatenate([2.0 * first, -first, zeros], axis=-1)
        + xp.concatenate([zeros, -last, 2.0 * last], axis=-1)
    )


def fit(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares control points of a sampled curve.

    values [F, D] at equal steps of time; returns (points [9, D], rms error [D]). The first
    and the last sample are met exactly, since start pose and standing must fit the curve.
    """
    values = np.asarray(values, np.float64)
    weight = basis(np.linspace(0.0, 1.0, len(values)))
    points = np.empty((NUM_POINTS, values.shape[1]))
    points[0], points[-1] = values[0], values[-1]
    rest = values - weight[:, [0, -1]] @ points[[0, -1]]
    points[1:-1] = np.linalg.lstsq(weight[:, 1:-1], rest, rcond=None)[0]
    error = np.sqrt(np.mean((weight @ points - values) ** 2, axis=0))
    return points, error


@dataclasses.dataclass(frozen=True)
class FeatureLinks:
    """Indices of the links that the features are measured at."""

    root: int
    neck: int
    left_hip: int
    right_hip: int

    @classmethod
    def of(cls, character: CharacterSpec) -> FeatureLinks:
        """Look the links up by name."""
        names = ("pelvis", "neck", "thigh_l", "thigh_r")
        return cls(*(character.link(name) for name in names))


def features(links: FeatureLinks, link_position: A, ground_height: A | float) -> A:
    """w = (h, theta_x, theta_z) of poses, in NumPy where the positions are NumPy's.

    link_position [..., L, 3] (m, world, Z up), ground_height [...] (m). Returns [..., 3]:
    height of the neck base above the ground (m), angle between the side vector (pelvis to its
    right) and up, angle between the front vector and up (rad, 0 to pi). Supine: the front
    angle is 0; prone: pi; standing: both are pi / 2.
    """
    height = link_position[..., links.neck, 2] - ground_height
    angles = _angle_to_up(torso_axes(links, link_position))
    return array_module(link_position).concatenate([height[..., None], angles], axis=-1)


def torso_axes(links: FeatureLinks, link_position: A) -> A:
    """Unit side and front vector [..., 2, 3] of the torso in poses [..., L, 3], world frame."""
    xp = array_module(link_position)
    neck = link_position[..., links.neck, :]
    right, left = (link_position[..., i, :] for i in (links.right_hip, links.left_hip))
    side = _unit(right - left)
    # [P 3.1]: the cross product of the hips-to-neck and the side vector points forward
    front = _unit(xp.cross(neck - 0.5 * (left + right), side))
    return xp.stack([side, front], axis=-2)


def _unit(v: A) -> A:
    xp = array_module(v)
    return v / xp.maximum(xp.linalg.norm(v, axis=-1, keepdims=True), 1e-8)


def _angle_to_up(unit: A) -> A:
    """Angle to +z; atan2 keeps its precision near 0 and pi, where arccos loses it."""
    xp = array_module(unit)
    return xp.arctan2(xp.linalg.norm(unit[..., :2], axis=-1), unit[..., 2])
