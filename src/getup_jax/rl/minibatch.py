"""Minibatch gradient steps, and the learning rate's adaptation between iterations."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

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


class Trainee(NamedTuple):
    """Parameters that learn from minibatches of some samples."""

    loss: Loss  # of the parameters on a minibatch, with metrics
    optimiser: optax.GradientTransformation  # see `make_optimiser`
    parameters: Any  # pytree
    optimiser_state: Any  # of the parameters
    minibatches: jax.Array  # [U, M] int32, sample numbers of U updates


# parameters, optimiser state, and the means over all updates of the metrics and of `gradient_norm`,
# before it was limited
Trained = tuple[Any, Any, dict[str, jax.Array]]


def run_minibatches(trainees: Sequence[Trainee], samples: Any) -> list[Trained]:
    """One gradient step for every row of each trainee's minibatches of samples, pytree [N, ...].

    On several devices each has its own samples and a part of every minibatch; the gradient is the
    mean over the devices, so that all make the same step. Trainees learn nothing from each other,
    but step side by side, so that their gradients are one message between the devices.
    """
    carries = [(trainee.parameters, trainee.optimiser_state) for trainee in trainees]
    found: list[list[dict[str, jax.Array]]] = [[] for _ in trainees]
    done = 0
    for end in sorted({len(trainee.minibatches) for trainee in trainees}):
        going = [i for i, trainee in enumerate(trainees) if len(trainee.minibatches) >= end]
        some = [trainees[i] for i in going]
        rows = [trainee.minibatches[done:end] for trainee in some]
        step = functools.partial(_step, some, samples)
        moved, metrics = jax.lax.scan(step, [carries[i] for i in going], rows)
        for i, carry, of_steps in zip(going, moved, metrics, strict=True):
            carries[i] = carry
            found[i].append(of_steps)
        done = end
    whole = [jax.tree.map(lambda *x: jnp.mean(jnp.concatenate(x)), *parts) for parts in found]
    whole = device_axis.averaged(whole)
    return [(*carry, metrics) for carry, metrics in zip(carries, whole, strict=True)]


def _step(
    trainees: Sequence[Trainee],
    samples: Any,
    carries: list[tuple[Any, Any]],
    rows: list[jax.Array],
) -> tuple[list[tuple[Any, Any]], list[dict[str, jax.Array]]]:
    """One update of each."""
    found = [
        jax.grad(trainee.loss, has_aux=True)(parameters, jax.tree.map(lambda x, r=r: x[r], samples))
        for trainee, (parameters, _), r in zip(trainees, carries, rows, strict=True)
    ]
    gradients = device_axis.averaged([gradient for gradient, _ in found])
    moved, metrics = [], []
    for trainee, (parameters, state), gradient, (_, of_loss) in zip(
        trainees, carries, gradients, found, strict=True
    ):
        updates, state = trainee.optimiser.update(gradient, state, parameters)
        moved.append((optax.apply_updates(parameters, updates), state))
        metrics.append({**of_loss, "gradient_norm": optax.tree.norm(gradient)})
    return moved, metrics


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
