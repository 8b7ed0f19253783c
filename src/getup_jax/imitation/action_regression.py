"""Behaviour cloning: servo targets are learned by regression before a policy trains by itself."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from flax import struct

from getup_jax.envs.getup import rewards
from getup_jax.envs.getup.action_decoder import ActionDecoder
from getup_jax.envs.getup.task import GetUpTask, World
from getup_jax.networks import gaussian
from getup_jax.rl.actor_critic import normalized
from getup_jax.rl.learner import Learner
from getup_jax.rl.minibatch import Loss, Trainee, run_minibatches, shuffled_minibatches
from getup_jax.rl.rollout import rollout
from getup_jax.rl.state import PolicyState

Log = Callable[[str], None]

_NOISE = 0.2  # standard deviation of the actions, to see what is beside the way, too
EPOCHS, _MINIBATCH = 30, 1024
_LEARNING_RATES = 1e-3, 1e-5
# of regression in rounds: its rates, limit of the gradient's norm, and updates by one portion
_ROUND_MINIBATCH, _ROUND_RATES, _ROUND_NORM, _PORTION = 2048, (4e-4, 1e-5), 1.0, 50
# Beside the squared error of the targets (rad^2):
_NEAR = 0.02  # to the demonstrated latents, since others may decode to the same pose
_NATURAL = 0.01  # (|dq|_1 / c)^2 of equation 3: what latents can say, offsets should not


@struct.dataclass
class Demonstrations:
    """N observations and what to do there; a pytree of [N, ...]."""

    observation: jax.Array  # [N, O] raw, its action in the units of the policy that learns
    action: jax.Array  # [N, A] likewise
    target: jax.Array  # [N, J] servo target (rad)
    condition: jax.Array  # [N, 3]


class Collector:
    """Demonstrations from what a policy sees in rollouts that go on from one to the next.

    Args:
        learner: whose numbers of simulations and steps a rollout has.
        env: where the policy acts.
        world: of `env`.
        mean_action: [N, A] of what is given to `collect`, for raw observations [N, O] of `env`.
        demonstrate: what to do there, of raw observations [N, O] likewise.
        key: of the starts.
    """

    def __init__(
        self,
        learner: Learner,
        env: GetUpTask,
        world: World,
        mean_action: Callable[[Any, jax.Array], jax.Array],
        demonstrate: Callable[[jax.Array], Demonstrations],
        key: jax.Array,
    ) -> None:
        num_envs, num_steps = learner.config.num_envs, learner.config.num_steps
        self._world = world
        self._state = jax.jit(env.init, static_argnums=2)(world, key, num_envs)

        @jax.jit
        def roll(world: World, policy: Any, state: Any, key: jax.Array):
            def act(observation: jax.Array, key_action: jax.Array) -> tuple[jax.Array, jax.Array]:
                mean = mean_action(policy, observation)
                std = jnp.full_like(mean, _NOISE)
                action = gaussian.sample(key_action, mean, std)
                return action, gaussian.log_prob(action, mean, std)

            collected = rollout(env, world, state, act, key, num_steps)
            observation = collected.transition.observation
            flat = observation.reshape(-1, observation.shape[-1])
            return collected.environment, demonstrate(flat)

        self._roll = roll

    def collect(self, policy: Any, keys: jax.Array) -> Demonstrations:
        """Of a rollout for each key [R], on the host."""
        parts = []
        for key in keys:
            self._state, part = self._roll(self._world, policy, self._state, key)
            parts.append(jax.device_get(part))
        return jax.tree.map(lambda *x: np.concatenate(x), *parts)


def collect(
    learner: Learner,
    env: GetUpTask,
    world: World,
    mean_action: Callable[[jax.Array], jax.Array],
    demonstrate: Callable[[jax.Array], Demonstrations],
    rollouts: int,
    key: jax.Array,
) -> Demonstrations:
    """What a `Collector` collects in some rollouts of a policy that stays what it is."""
    keys = jax.random.split(key, rollouts + 1)
    collector = Collector(
        learner, env, world, lambda _, observation: mean_action(observation), demonstrate, keys[0]
    )
    return jax.tree.map(jnp.asarray, collector.collect(None, keys[1:]))


def join(parts: list[Demonstrations]) -> Demonstrations:
    """All of them in one, in their order."""
    return jax.tree.map(lambda *x: jnp.concatenate(x), *parts)


def split(demos: Demonstrations, size: int) -> tuple[Demonstrations, Demonstrations]:
    """All but the last `size`, and those."""
    first, last = (
        jax.tree.map(lambda x, part=part: x[part], demos)
        for part in (slice(None, -size), slice(-size, None))
    )
    return first, last


def clone(
    learner: Learner,
    policy: PolicyState,
    decoder: ActionDecoder,
    demos: Demonstrations,
    key: jax.Array,
) -> PolicyState:
    """The policy after regression of its targets, with latents as far as they can say them."""
    loss = _cloning_loss(learner, policy, decoder)
    actor = regress(loss, policy.actor, demos, key, EPOCHS, _MINIBATCH)
    return dataclasses.replace(policy, actor=actor)


class Cloning:
    """The same regression in rounds, for demonstrations that come in meanwhile.

    One optimiser goes through all of them, its rate falling along a cosine: the first large steps
    of a fresh one would undo each time what is learned already.
    """

    def __init__(
        self, learner: Learner, policy: PolicyState, decoder: ActionDecoder, updates: int
    ) -> None:
        """updates: of all rounds together."""
        first, last = _ROUND_RATES
        rate = optax.cosine_decay_schedule(first, updates, last / first)
        optimiser = optax.chain(optax.clip_by_global_norm(_ROUND_NORM), optax.adam(rate))
        loss = _cloning_loss(learner, policy, decoder)
        self._policy, self._carry = policy, (policy.actor, optimiser.init(policy.actor))

        @jax.jit
        def some(carry: tuple[Any, Any], samples: Any) -> tuple[Any, Any]:
            order = jnp.arange(len(samples.target)).reshape(-1, _ROUND_MINIBATCH)
            (trained,) = run_minibatches((Trainee(loss, optimiser, *carry, order),), samples)
            return trained[:2]

        self._some = some

    @property
    def policy(self) -> PolicyState:
        """As far as it has learned."""
        return dataclasses.replace(self._policy, actor=self._carry[0])

    def learn(
        self, demos: Sequence[Demonstrations], updates: int, rng: np.random.Generator
    ) -> None:
        """Updates (about, whole portions) by minibatches of random samples of all demos."""
        sizes = [len(part.target) for part in demos]
        ends = np.cumsum(sizes)
        for _ in range(max(1, round(updates / _PORTION))):
            rows = rng.integers(0, ends[-1], _PORTION * _ROUND_MINIBATCH)
            part_of = np.searchsorted(ends, rows, side="right")
            # not all of them joined, which would be gigabytes
            taken = [
                jax.tree.map(lambda x, r=rows[part_of == i] - (ends[i] - sizes[i]): x[r], part)
                for i, part in enumerate(demos)
            ]
            order = rng.permutation(len(rows))
            samples = jax.tree.map(lambda *x, o=order: np.concatenate(x)[o], *taken)
            self._carry = self._some(self._carry, samples)


def _cloning_loss(learner: Learner, policy: PolicyState, decoder: ActionDecoder) -> Loss:
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
