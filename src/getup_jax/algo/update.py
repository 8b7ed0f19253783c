"""Minibatch gradient steps, and the learning rate's adaptation between iterations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax

# (parameters, minibatch) -> (scalar loss, metrics)
Loss = Callable[[Any, Any], tuple[jax.Array, dict[str, jax.Array]]]

# Adam's epsilon of the PPO implementations; optax's own default is a thousand times smaller.
ADAM_EPSILON = 1e-5

# The rate moves by this factor an iteration, once the clip fraction is that far from its target ...
SCALE_STEP = 1.2
CLIP_FRACTION_BAND = 1.25
# ... and never further from the schedule than this.
SCALE_RANGE = (0.05, 5.0)


def make_optimiser(
    max_gradient_norm: float, learning_rate: jax.Array | float, critic_scale: float = 1.0
) -> optax.GradientTransformation:
    """Adam after clipping the norm of the whole gradient.

    The rate is an argument of the traced step, so its state has the same form at every rate. With
    a `critic_scale`, the parameters are (actor, critic), and the critic's rate is that many times
    as large.
    """
    adam = (
        optax.clip_by_global_norm(max_gradient_norm),
        optax.scale_by_adam(eps=ADAM_EPSILON),
        optax.scale(-learning_rate),
    )
    if critic_scale == 1.0:
        return optax.chain(*adam)
    return optax.chain(*adam, optax.stateless(lambda updates, _: _scale(updates, critic_scale)))


def _scale(updates: Any, critic_scale: float) -> tuple[Any, Any]:
    actor, critic = updates
    return actor, jax.tree.map(lambda x: critic_scale * x, critic)


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

    Args:
        loss: of the parameters on a minibatch, with metrics.
        optimiser: see `make_optimiser`.
        parameters: pytree.
        optimiser_state: of the parameters.
        samples: pytree of [N, ...].
        minibatches: [U, M] int32, sample numbers of U updates.

    Returns:
        Parameters, optimiser state, and the metrics' means over all updates.
    """

    def minibatch_update(carry: tuple[Any, Any], rows: jax.Array):
        parameters, optimiser_state = carry
        minibatch = jax.tree.map(lambda x: x[rows], samples)
        gradient, metrics = jax.grad(loss, has_aux=True)(parameters, minibatch)
        updates, optimiser_state = optimiser.update(gradient, optimiser_state, parameters)
        metrics = {**metrics, "ppo/gradient_norm": optax.tree.norm(gradient)}
        return (optax.apply_updates(parameters, updates), optimiser_state), metrics

    carry = (parameters, optimiser_state)
    (parameters, optimiser_state), metrics = jax.lax.scan(minibatch_update, carry, minibatches)
    return parameters, optimiser_state, jax.tree.map(jnp.mean, metrics)


def adapt_scale(scale: jax.Array, clip_fraction: jax.Array, target: float | None) -> jax.Array:
    """The factor on the next iteration's learning rate, for this iteration's clip fraction.

    Divided by SCALE_STEP above CLIP_FRACTION_BAND * target, multiplied below target /
    CLIP_FRACTION_BAND, kept in SCALE_RANGE; target None leaves it alone.
    """
    if target is None:
        return scale
    slower = jnp.where(clip_fraction > CLIP_FRACTION_BAND * target, 1.0 / SCALE_STEP, 1.0)
    faster = jnp.where(clip_fraction < target / CLIP_FRACTION_BAND, SCALE_STEP, 1.0)
    return jnp.clip(scale * slower * faster, *SCALE_RANGE)
