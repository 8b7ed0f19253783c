"""Running mean and variance of the observations, safe in float32.

The sums of textbook formulas lose float32's 24 bits after some million samples. Here each batch is
reduced to its own moments, which are then merged as fractions of the whole (Chan et al. 1983):

    fraction = n_b / (n_a + n_b)        delta = mean_b - mean_a
    mean     = mean_a + fraction * delta
    variance = var_a + fraction * (var_b - var_a) + fraction * (1 - fraction) * delta^2

Nothing grows but the count, which enters only through the fraction. Should it saturate, the
statistics turn into a moving average over about 2^24 batches; they never turn wrong. Late in a run
the fraction is so small that a step of the mean may be below its last digit, so what rounding cuts
off is kept and added to the next step (Kahan 1965).
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.core import device_axis
from getup_jax.core.mirror import SignedPermutation

# In standard deviations. Beyond it a value says only that something rare happened; unclipped, one
# such input dominates every layer after it.
CLIP = 10.0

# Added to the variance, so that rounding noise of a constant observation is not blown up.
EPSILON = 1e-6


@struct.dataclass
class Moments:
    """Count, mean and variance of samples; the variance is divided by the count."""

    count: jax.Array  # [] float32
    mean: jax.Array  # [O] in the observation's units
    residue: jax.Array  # [O] what rounding cut off the mean
    variance: jax.Array  # [O] in their squares


def initial(size: int) -> Moments:
    """Moments of no samples [O = size]; `normalize` with them only clips (almost)."""
    return Moments(
        count=jnp.zeros((), jnp.float32),
        mean=jnp.zeros(size, jnp.float32),
        residue=jnp.zeros(size, jnp.float32),
        variance=jnp.ones(size, jnp.float32),
    )


def moments_of(x: jax.Array, near: jax.Array) -> Moments:
    """Moments of a batch x[..., O], in two passes.

    `near` [O] is any guess of the mean: sums of small numbers round less. It must be the same on
    all devices, as the running mean is.
    """
    axes = tuple(range(x.ndim - 1))
    count = jnp.asarray(x.size // x.shape[-1], jnp.float32)
    offset = device_axis.averaged(jnp.sum(x - near, axes) / count)
    variance = device_axis.averaged(jnp.sum(jnp.square(x - near - offset), axes) / count)
    count = device_axis.summed(count)
    mean, residue = _add(near, offset)
    return Moments(count=count, mean=mean, residue=residue, variance=variance)


def merge(a: Moments, b: Moments) -> Moments:
    """Moments of the union of two sets of samples; b must not be empty."""
    count = a.count + b.count
    fraction = b.count / count
    delta = (b.mean - a.mean) + (b.residue - a.residue)
    mean, residue = _add(a.mean, fraction * delta + a.residue)
    spread = fraction * (1.0 - fraction) * jnp.square(delta)
    variance = a.variance + fraction * (b.variance - a.variance) + spread
    return Moments(count=count, mean=mean, residue=residue, variance=variance)


def _add(mean: jax.Array, step: jax.Array) -> tuple[jax.Array, jax.Array]:
    """mean + step rounded to float32, and what the rounding cut off."""
    total = mean + step
    return total, step - (total - mean)


def update(
    moments: Moments,
    x: jax.Array,
    horizon: float = math.inf,
    mirror: SignedPermutation | None = None,
) -> Moments:
    """The running moments with a batch x[..., O] added, and its images where there is a mirror.

    What was seen before counts for at most `horizon` samples: a longer run forgets, as a moving
    average does, and so follows what it is shown later.
    """
    before = moments.replace(count=jnp.minimum(moments.count, horizon))
    batch = moments_of(x, moments.mean)
    return merge(before, batch if mirror is None else symmetric(batch, mirror))


def symmetric(moments: Moments, mirror: SignedPermutation) -> Moments:
    """Moments of the samples and their mirror images together, which count as one."""
    mean, variance = mirror.moments(moments.mean, moments.variance)
    residue = 0.5 * (moments.residue + mirror.linear()(moments.residue))
    return moments.replace(mean=mean, residue=residue, variance=variance)


def normalize(moments: Moments, x: jax.Array, least_std: float = 0.0) -> jax.Array:
    """(x - mean) / sqrt(variance + EPSILON), clipped to +-CLIP, for x[..., O].

    Variances count as at least that of `least_std`.
    """
    variance = jnp.maximum(moments.variance, least_std**2) if least_std else moments.variance
    z = (x - moments.mean) * jax.lax.rsqrt(variance + EPSILON)
    return jnp.clip(z, -CLIP, CLIP)
