"""What a teacher would do in the states that a policy gets to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from getup_jax.envs.getup.task import GetUpTask, World
from getup_jax.networks import gaussian
from getup_jax.rl.learner import Learner
from getup_jax.rl.rollout import rollout

Log = Callable[[str], None]

_NOISE = 0.2  # standard deviation of the actions, to see what is beside the way, too


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
