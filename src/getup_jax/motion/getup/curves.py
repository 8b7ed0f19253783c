"""Style curves: uniform cubic B-splines with nine control points a feature.

[P 4.1] asks for a cardinal (uniform-knot) cubic B-spline whose nine control points may be
samples at nine equal steps of time. Phantom points p_-1 = 2 p_0 - p_1 and p_9 = 2 p_8 - p_7
extend the ends, so that the curve starts and ends exactly at its first and last point.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

NUM_POINTS = 9


def evaluate(points: jax.Array, s: jax.Array) -> jax.Array:
    """Curve values at phase s.

    points [..., 9, D] and s [...] in [0, 1] (clipped) with equal leading axes; returns
    [..., D]. Equation 1's min((t - t0) / T, 1) is this clip.
    """
    return jnp.einsum("...n,...nd->...d", basis(s), points)


def basis(s: jax.Array) -> jax.Array:
    """Weights [..., 9] of the control points at phase s [...]."""
    u = jnp.clip(s, 0.0, 1.0) * (NUM_POINTS - 1)
    distance = u[..., None] - jnp.arange(-1, NUM_POINTS + 1)
    weight = _bspline(distance)
    return _fold_phantoms(weight)


def _bspline(x: jax.Array) -> jax.Array:
    """The centred uniform cubic B-spline, non-zero for |x| < 2."""
    x = jnp.abs(x)
    near = 2.0 / 3.0 - x**2 + x**3 / 2.0
    far = (2.0 - x) ** 3 / 6.0
    return jnp.where(x < 1.0, near, jnp.where(x < 2.0, far, 0.0))


def _fold_phantoms(weight: jax.Array) -> jax.Array:
    """Give the two phantom points' weights [..., 11] to the points that define them."""
    first, inner, last = weight[..., :1], weight[..., 1:-1], weight[..., -1:]
    zeros = jnp.zeros_like(inner[..., :-2])
    return (
        inner
        + jnp.concatenate([2.0 * first, -first, zeros], axis=-1)
        + jnp.concatenate([zeros, -last, 2.0 * last], axis=-1)
    )


def fit(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares control points of a sampled curve.

    values [F, D] at equal steps of time; returns (points [9, D], rms error [D]). The first
    and the last sample are met exactly, since start pose and standing must fit the curve.
    """
    values = np.asarray(values, np.float64)
    weight = np.asarray(basis(jnp.linspace(0.0, 1.0, len(values))), np.float64)
    points = np.empty((NUM_POINTS, values.shape[1]))
    points[0], points[-1] = values[0], values[-1]
    rest = values - weight[:, [0, -1]] @ points[[0, -1]]
    points[1:-1] = np.linalg.lstsq(weight[:, 1:-1], rest, rcond=None)[0]
    error = np.sqrt(np.mean((weight @ points - values) ** 2, axis=0))
    return points, error
