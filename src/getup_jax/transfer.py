"""Carries a trained policy over to another pose prior, so that other motions need no fresh start.

A policy acts by latent poses, and those of two priors have nothing to do with each other. What the
old policy means by an action is a servo target. The new prior has an action for it, too: the latent
that it encodes the old pose by, and offsets for what it cannot decode. So the old policy is run on
the new task under the old prior, and its actor is trained, by regression, to name its targets in
the units of the new one.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct

from getup_jax.algo import normalize
from getup_jax.algo.actor_critic import normalized
from getup_jax.algo.learner import Learner
from getup_jax.algo.rollout import rollout
from getup_jax.algo.state import PolicyState
from getup_jax.algo.update import run_minibatches, shuffled_minibatches
from getup_jax.config import TaskConfig
from getup_jax.nets import gaussian
from getup_jax.nets.prior import PosePrior
from getup_jax.tasks import rewards
from getup_jax.tasks.actions import Units
from getup_jax.tasks.getup import GetUpTask, World

_ROLLOUTS = 24  # the last one is held out
_NOISE = 0.2  # standard deviation of the actions, to see what is beside the way, too
_EPOCHS, _MINIBATCH = 30, 1024
_LEARNING_RATES = 1e-3, 1e-5
# Beside the squared error of the targets (rad^2):
_NEAR = 0.02  # to the latents that encode the old poses, since others may decode to the same
_NATURAL = 0.01  # (|dq|_1 / c)^2 of equation 3: what latents can say, offsets should not


@struct.dataclass
class Lesson:
    """N observations and what to do there; a pytree of [N, ...]."""

    observation: jax.Array  # [N, O] raw, its action in the new units
    action: jax.Array  # [N, A] in the new units
    target: jax.Array  # [N, J] servo target (rad)
    condition: jax.Array  # [N, 3]


def carry_over(
    learner: Learner,
    world: World,
    policy: PolicyState,
    task: TaskConfig,
    prior: PosePrior,
    key: jax.Array,
    log: Callable[[str], None],
) -> PolicyState:
    """The policy with an actor for the prior and the offsets of `learner` and `world`.

    Args:
        learner: of the new task.
        world: of the new task.
        policy: trained under `task` and `prior`.
        task: settings of the old task; what its actions mean.
        prior: of the old task.
        key: of the starts, the noise and the order of the minibatches.
        log: gets a line before and after.

    Returns the same policy where an action means the same under both.
    """
    env = learner.env
    assert isinstance(env, GetUpTask)
    assert world.prior is not None
    old = Units(prior, task.offset_scale)
    new = Units(world.prior, env.config.offset_scale)
    if old.same(new):
        return policy
    log("its pose prior or its offsets are others: teaching the actor those of this run ...")
    key_roll, key_order = jax.random.split(key)
    lessons = _lessons(learner, env, world, policy, (old, new), key_roll)
    size = len(lessons.observation) // _ROLLOUTS
    training = jax.tree.map(lambda x: x[:-size], lessons)
    heldout = jax.tree.map(lambda x: x[-size:], lessons)
    block = env.observer.slices()["action"]
    policy = dataclasses.replace(
        policy, statistics=_restated(policy.statistics, lessons.observation, block)
    )
    before, _ = _compare(learner, policy, new, heldout)
    policy = _taught(learner, policy, new, training, key_order)
    after, offsets = _compare(learner, policy, new, heldout)
    log(
        f"its servo targets differ by {after:.2f} degrees (rms) now, {before:.1f} before; "
        f"offsets |dq|_1 {offsets:.1f} rad"
    )
    return policy


def _lessons(
    learner: Learner,
    env: GetUpTask,
    world: World,
    policy: PolicyState,
    units: tuple[Units, Units],
    key: jax.Array,
) -> Lesson:
    """What the old policy does on the new task, in rollouts that go on from one to the next."""
    (old, new), slices = units, env.observer.slices()
    config = dataclasses.replace(env.config, offset_scale=old.offset_scale, paths=None)
    env = dataclasses.replace(env, config=config)
    world = world.replace(prior=old.prior, pool=world.pool.replace(action=None))
    num_envs, num_steps = learner.config.num_envs, learner.config.num_steps

    def act(observation: jax.Array, key_action: jax.Array):
        mean = learner.act(policy, observation)
        std = jnp.full_like(mean, _NOISE)
        action = gaussian.sample(key_action, mean, std)
        return action, gaussian.log_prob(action, mean, std)

    def lesson(observation: jax.Array) -> Lesson:
        condition = observation[..., slices["targets"]][..., :3]
        mean = learner.act(policy, observation)
        seen = old.translate(observation[..., slices["action"]], condition, new)
        return Lesson(
            observation=observation.at[..., slices["action"]].set(seen),
            action=old.translate(mean, condition, new),
            target=old.target(mean, condition),
            condition=condition,
        )

    @jax.jit
    def collect(world: World, state: Any, key: jax.Array) -> tuple[Any, Lesson]:
        collected = rollout(env, world, state, act, key, num_steps)
        observation = collected.transition.observation
        flat = observation.reshape(-1, observation.shape[-1])
        return collected.environment, lesson(flat)

    keys = jax.random.split(key, _ROLLOUTS + 1)
    state = env.init(world, keys[0], num_envs)
    parts = []
    for key_roll in keys[1:]:
        state, part = collect(world, state, key_roll)
        parts.append(jax.device_get(part))
    return jax.tree.map(lambda *x: jnp.concatenate(x), *parts)


def _restated(
    statistics: normalize.Moments | None, observation: jax.Array, block: slice
) -> normalize.Moments | None:
    """The statistics, those of the observation's action [N, O] in the new units."""
    if statistics is None:
        return None
    fresh = normalize.moments_of(observation, jnp.mean(observation, axis=0))
    return statistics.replace(
        **{
            name: getattr(statistics, name).at[block].set(getattr(fresh, name)[block])
            for name in ("mean", "residue", "variance")
        }
    )


def _taught(
    learner: Learner, policy: PolicyState, units: Units, lessons: Lesson, key: jax.Array
) -> PolicyState:
    """The policy after regression of its targets, with latents as far as they can say them."""
    count = len(lessons.observation)
    size = min(_MINIBATCH, count)
    updates = count // size
    rate = optax.cosine_decay_schedule(
        _LEARNING_RATES[0], _EPOCHS * updates, _LEARNING_RATES[1] / _LEARNING_RATES[0]
    )
    optimiser = optax.adam(rate)
    latents, limit = units.latent_size, learner.env.config.offset_limit_rad

    def loss(actor: Any, part: Lesson) -> tuple[jax.Array, dict[str, jax.Array]]:
        seen = normalized(policy, part.observation)
        action = learner.model.mean(actor, seen)
        miss = jnp.mean(jnp.square(units.target(action, part.condition) - part.target))
        (latent, offset), (near, _) = (jnp.split(a, [latents], -1) for a in (action, part.action))
        far = jnp.mean(jnp.square(latent - near))
        unnatural = jnp.mean(1.0 - rewards.natural(units.offset_scale * offset, limit))
        return miss + _NEAR * far + _NATURAL * unnatural, {"miss": miss}

    @jax.jit
    def epoch(carry: tuple[Any, Any], key: jax.Array) -> tuple[Any, Any]:
        order = shuffled_minibatches(key, 1, updates * size, size)
        return run_minibatches(loss, optimiser, *carry, lessons, order)[:2]

    carry = (policy.actor, optimiser.init(policy.actor))
    for key_epoch in jax.random.split(key, _EPOCHS):
        carry = epoch(carry, key_epoch)
    return dataclasses.replace(policy, actor=carry[0])


def _compare(
    learner: Learner, policy: PolicyState, units: Units, lessons: Lesson
) -> tuple[float, float]:
    """How far the policy's servo targets are from the old ones (degrees, rms), and |dq|_1 (rad)."""
    action = jax.jit(learner.act)(policy, lessons.observation)
    miss = jnp.mean(jnp.square(units.target(action, lessons.condition) - lessons.target))
    offset = units.offset_scale * action[:, units.latent_size :]
    length = jnp.mean(jnp.sum(jnp.abs(offset), axis=-1))
    return math.degrees(math.sqrt(miss)), float(length)
