"""PopArt: value targets of every objective normalised, with the critic's outputs preserved.

The critic's last layer gives n = W x + b in normalised units, and the value is std * n + mean
(van Hasselt et al. 2016). When the statistics move, that layer moves against them, so that the
value stays what it was:

    W' = W std / std'        b' = (std b + mean - mean') / std'

Statistics are moving averages of the batch moments with `MOMENTUM`, debiased as in Adam (Kingma and
Ba 2015), so that the first batch counts in full. Xu et al. 2023 (composite motion, section 4.3)
keep one pair of scalars for each objective and update once an iteration.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct

from getup_jax.core import device_axis
from getup_jax.networks.mlp import OUTPUT_LAYER

MOMENTUM = 0.1  # share of the newest batch, once many have been seen
MIN_STD = 1e-4  # in return units; a constant target must not divide by zero


@struct.dataclass
class PopArt:
    """Debiased moving moments of the value targets, one for each of K objectives."""

    mean: jax.Array  # [K] in return units
    variance: jax.Array  # [K] in their squares
    weight: jax.Array  # [] share of the averages that batches have filled, 0 to 1

    @property
    def std(self) -> jax.Array:
        """[K] in return units, at least MIN_STD."""
        return jnp.maximum(jnp.sqrt(self.variance), MIN_STD)


def initial(num_objectives: int) -> PopArt:
    """Statistics that change nothing: mean 0, std 1, no batch seen."""
    return PopArt(
        mean=jnp.zeros(num_objectives, jnp.float32),
        variance=jnp.ones(num_objectives, jnp.float32),
        weight=jnp.zeros((), jnp.float32),
    )


def update(popart: PopArt, target: jax.Array) -> PopArt:
    """The statistics with a batch of value targets [..., K] added.

    The averages E[x] and E[x^2] of the paper, written for the mean and the variance: their
    difference would cancel in float32 where the mean is large.
    """
    axes = tuple(range(target.ndim - 1))
    weight = popart.weight + MOMENTUM * (1.0 - popart.weight)
    fraction = MOMENTUM / weight
    delta = device_axis.mean(target, axes) - popart.mean
    spread = fraction * (1.0 - fraction) * jnp.square(delta)
    newest = device_axis.var(target, axes)
    variance = popart.variance + fraction * (newest - popart.variance) + spread
    return PopArt(mean=popart.mean + fraction * delta, variance=variance, weight=weight)


def normalize(popart: PopArt, target: jax.Array) -> jax.Array:
    """Value targets [..., K] from return units to the critic's."""
    return (target - popart.mean) / popart.std


def denormalize(popart: PopArt, output: jax.Array) -> jax.Array:
    """Critic outputs [..., K] to return units."""
    return popart.mean + popart.std * output


def rescale(critic: dict[str, Any], old: PopArt, new: PopArt) -> dict[str, Any]:
    """The critic's variables with the last layer moved, so that every value is preserved."""
    moved = _scale_output(critic, old.std / new.std)
    moved["params"][OUTPUT_LAYER]["bias"] += (old.mean - new.mean) / new.std
    return moved


def rescale_moments(optimiser: Any, old: PopArt, new: PopArt) -> Any:
    """Adam's state of the critic with the moments of the last layer moved along with it.

    An error of the same size in return units is std / std' as large in the new ones, and so is the
    last layer's gradient; its square goes with the square. Moments in the old units would take the
    next steps for too small or too large.
    """
    ratio = old.std / new.std
    return optax.tree.set(
        optimiser,
        mu=_scale_output(optax.tree.get(optimiser, "mu"), ratio),
        nu=_scale_output(optax.tree.get(optimiser, "nu"), jnp.square(ratio)),
    )


def _scale_output(critic: dict[str, Any], ratio: jax.Array) -> dict[str, Any]:
    """The critic's variables, or their moments, with the last layer times ratio [K]."""
    layers = critic["params"]
    output = {name: x * ratio for name, x in layers[OUTPUT_LAYER].items()}
    return {**critic, "params": {**layers, OUTPUT_LAYER: output}}
