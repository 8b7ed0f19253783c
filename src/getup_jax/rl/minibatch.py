"""Minibatch gradient steps, and the learning rate's adaptation between iterations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax

from getup_jax.core import device_axis

# (parameters, minibatch) -> (scalar loss, metrics)
Loss = Callable[[Any, Any], tuple[jax.Array, dict[str, jax.Array]]]

# Of the PPO implementations, a thousand times optax's own; small beside the actor's gradients.
ACTOR_EPSILON = 1e-5
# The critic's gradients are smaller: beside them 1e-5 would slow what has hardly any left.
CRITIC_EPSILON = 1e-8

# The rate starts at this share of the schedule: the first full step of a trained policy with little
# noise would be too far ...
FIRST_SCALE = 0.05
# ... and moves by these factors an iteration, once the clip fraction is that far from its target.
SCALE_STEPS = ((1.25, 1.2), (2.5, 1.25))  # (distance, factor); beyond both, both
# It is never above the schedule, which so can end a run with small steps.
SCALE_RANGE = (1e-3, 1.0)


def make_optimiser(
    max_gradient_norm: float, learning_rate: jax.Array | float, epsilon: float
) -> optax.GradientTransformation:
    """Adam after clipping the gradient's norm.

    The rate is an argument of the traced step, so its state has the same form at every rate.
    """
    return optax.chain(
        optax.clip_by_global_norm(max_gradient_norm),
        optax.scale_by_adam(eps=epsilon),
        optax.scale(-learning_rate),
    )


def shuffled_minibatches(
    key: jax.Array, epochs: int, num_samples: int, minibatch_size: int
) -> jax.Array:
    """Sample numbers [epochs * N / M, M] int32: each epoch is a fresh permutation of all N."""
    keys = jax.random.split(key, epochs)
    order = jax.vmap(lambda key_epoch: jax.random.permutation(key_epoch, num_samples))(keys)
    return order.reshape(-1, minibatch_size)


def run_minibatches(
    loss: Loss,
    optimiser: optax.GradientTransformation,
    parameters: Any,
    optimiser_state: Any,
    samples: Any,
    minibatches: jax.Array,
) -> tuple[Any, Any, dict[str, jax.Array]]:
    """One gradient step for every row of `minibatches`.

    On several devices each has its own samples and a part of every minibatch; the gradient is the
    mean over the devices, so that all make the same step.

    Args:
        loss: of the parameters on a minibatch, with metrics.
        optimiser: see `make_optimiser`.
        parameters: pytree.
        optimiser_state: of the parameters.
        samples: pytree of [N, ...].
        minibatches: [U, M] int32, sample numbers of U updates.

    Returns:
        Parameters, optimiser state, and the means over all updates of the metrics and of
        `gradient_norm`, before it was limited.
    """

    def minibatch_update(carry: tuple[Any, Any], rows: jax.Array):
        parameters, optimiser_state = carry
        minibatch = jax.tree.map(lambda x: x[rows], samples)
        gradient, metrics = jax.grad(loss, has_aux=True)(parameters, minibatch)
        gradient = device_axis.averaged(gradient)
        updates, optimiser_state = optimiser.update(gradient, optimiser_state, parameters)
        metrics = {**metrics, "gradient_norm": optax.tree.norm(gradient)}
        return (optax.apply_updates(parameters, updates), optimiser_state), metrics

    carry = (parameters, optimiser_state)
    (parameters, optimiser_state), metrics = jax.lax.scan(minibatch_update, carry, minibatches)
    metrics = device_axis.averaged(jax.tree.map(jnp.mean, metrics))
    return parameters, optimiser_state, metrics


def adapt_scale(scale: jax.Array, clip_fraction: jax.Array, target: float | None) -> jax.Array:
    """The factor on the next iteration's learning rate, for this iteration's clip fraction.

    For each (distance, factor) of SCALE_STEPS it is divided by the factor above distance * target,
    and multiplied below target / distance; kept in SCALE_RANGE. target None leaves it alone.
    """
    if target is None:
        return scale
    for distance, factor in SCALE_STEPS:
        slower = jnp.where(clip_fraction > distance * target, 1.0 / factor, 1.0)
        faster = jnp.where(clip_fraction < target / distance, factor, 1.0)
        scale = scale * slower * faster
    return jnp.clip(scale, *SCALE_RANGE)


def first_scale(target: float | None) -> jax.Array:
    """What a fresh learner starts with: FIRST_SCALE where the rate adapts, else 1."""
    return jnp.asarray(1.0 if target is None else FIRST_SCALE, jnp.float32)
