"""Behaviour cloning: servo targets are learned by regression before a policy trains by itself."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import optax

from getup_jax.envs.getup import rewards
from getup_jax.envs.getup.action_decoder import ActionDecoder
from getup_jax.imitation.demonstrations import Demonstrations
from getup_jax.rl.actor_critic import normalized
from getup_jax.rl.learner import Learner
from getup_jax.rl.minibatch import Loss, Trainee, run_minibatches, shuffled_minibatches
from getup_jax.rl.state import PolicyState

EPOCHS, _MINIBATCH = 30, 1024
_LEARNING_RATES = 1e-3, 1e-5
# Beside the squared error of the targets (rad^2):
_NEAR = 0.02  # to the demonstrated latents, since others may decode to the same pose
_NATURAL = 0.01  # (|dq|_1 / c)^2 of equation 3: what latents can say, offsets should not


def clone(
    learner: Learner,
    policy: PolicyState,
    decoder: ActionDecoder,
    demos: Demonstrations,
    key: jax.Array,
) -> PolicyState:
    """The policy after regression of its targets, with latents as far as they can say them."""
    loss = cloning_loss(learner, policy, decoder)
    actor = regress(loss, policy.actor, demos, key, EPOCHS, _MINIBATCH)
    return dataclasses.replace(policy, actor=actor)


def cloning_loss(learner: Learner, policy: PolicyState, decoder: ActionDecoder) -> Loss:
    """Of the actor on demonstrations; the statistics are those of the policy."""
    latents, limit = decoder.latent_size, learner.env.config.offset_limit_rad

    def loss(actor: Any, part: Demonstrations) -> tuple[jax.Array, dict[str, jax.Array]]:
        seen = normalized(policy, part.observation)
        action = learner.model.mean(actor, seen)
        miss = jnp.mean(jnp.square(decoder.target(action, part.condition) - part.target))
        (latent, offset), (near, _) = (jnp.split(a, [latents], -1) for a in (action, part.action))
        if decoder.prior is None:
            return miss, {"miss": miss}
        far = jnp.mean(jnp.square(latent - near))
        unnatural = jnp.mean(1.0 - rewards.natural(decoder.offset_scale * offset, limit))
        return miss + _NEAR * far + _NATURAL * unnatural, {"miss": miss}

    return loss


def regress(
    loss: Loss, parameters: Any, samples: Any, key: jax.Array, epochs: int, minibatch: int
) -> Any:
    """The parameters after epochs of Adam, its rate falling along a cosine.

    samples: pytree of [N, ...]; an epoch leaves out what fills no minibatch of them.
    """
    count = len(jax.tree.leaves(samples)[0])
    size = min(minibatch, count)
    updates = count // size
    first, last = _LEARNING_RATES
    optimiser = optax.adam(optax.cosine_decay_schedule(first, epochs * updates, last / first))

    @jax.jit
    def epoch(carry: tuple[Any, Any], samples: Any, key: jax.Array) -> tuple[Any, Any]:
        order = shuffled_minibatches(key, 1, updates * size, size)
        (trained,) = run_minibatches((Trainee(loss, optimiser, *carry, order),), samples)
        return trained[:2]

    carry = (parameters, optimiser.init(parameters))
    samples = jax.tree.map(jnp.asarray, samples)
    for key_epoch in jax.random.split(key, epochs):
        carry = epoch(carry, samples, key_epoch)
    return carry[0]


def compare(
    learner: Learner, policy: PolicyState, decoder: ActionDecoder, demos: Demonstrations
) -> tuple[float, float]:
    """How far the policy's servo targets are from the demos' (degrees, rms), and |dq|_1 (rad)."""
    action = jax.jit(learner.act)(policy, demos.observation)
    miss = jnp.mean(jnp.square(decoder.target(action, demos.condition) - demos.target))
    offset = decoder.offset(action)
    length = jnp.mean(jnp.sum(jnp.abs(offset), axis=-1))
    return math.degrees(math.sqrt(miss)), float(length)
