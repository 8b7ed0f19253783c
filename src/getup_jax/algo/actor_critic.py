"""The actor and the critic with the normalisation around them."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp

from getup_jax.algo import normalize, popart
from getup_jax.algo.state import LearnerState, PolicyState
from getup_jax.algo.update import make_optimiser
from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.nets.mlp import MLP
from getup_jax.nets.recurrent import HistoryMLP
from getup_jax.types import Environment

# Gain of the actor's last kernel: the first actions are noise around zero.
ACTOR_OUTPUT_SCALE = 0.01

# Bounds of the log std that an actor gives, in e-folds around the first one.
LOG_STD_RANGE = 2.0

Network = MLP | HistoryMLP


@dataclasses.dataclass(frozen=True)
class ActorCritic:
    """Two networks that share nothing but the normalised observation; variables are arguments."""

    actor: Network  # to the mean action [A]; with its log std [2 A] where `initial_std` is given
    critic: Network  # to K outputs
    observation_size: int  # O
    initial_std: float | None = None  # None: the std is a setting, not the actor's

    def init(self, key: jax.Array, config: PPOConfig) -> LearnerState:
        """Fresh variables, and the statistics that the settings ask for."""
        key_actor, key_critic = jax.random.split(key)
        observation = jnp.zeros(self.observation_size, jnp.float32)
        actor = self.actor.init(key_actor, observation)
        critic = self.critic.init(key_critic, observation)
        normalized = config.normalize_observation
        statistics = normalize.initial(self.observation_size) if normalized else None
        return LearnerState(
            policy=PolicyState(actor=actor, statistics=statistics),
            critic=critic,
            optimiser=make_optimiser(config.max_gradient_norm, 0.0, config.critic_rate_scale).init(
                (actor, critic)
            ),
            popart=popart.initial(self.critic.output_size) if config.popart else None,
            learning_rate_scale=jnp.ones((), jnp.float32),
        )

    def mean(self, actor: Any, normalized: jax.Array) -> jax.Array:
        """Mean actions [..., A] for normalised observations [..., O]."""
        output: Any = self.actor.apply(actor, normalized)
        return output if self.initial_std is None else jnp.split(output, 2, axis=-1)[0]

    def distribution(
        self, actor: Any, normalized: jax.Array, std: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        """Mean [..., A] and std of the actions; `std` [A] is the setting where it is one."""
        output: Any = self.actor.apply(actor, normalized)
        if self.initial_std is None:
            return output, std
        mean, log_std = jnp.split(output, 2, axis=-1)
        log_std = jnp.clip(log_std, -LOG_STD_RANGE, LOG_STD_RANGE) + math.log(self.initial_std)
        return mean, jnp.exp(log_std)

    def output(self, critic: Any, normalized: jax.Array) -> jax.Array:
        """Critic outputs [..., K] in the critic's units for normalised observations [..., O]."""
        output: Any = self.critic.apply(critic, normalized)
        return output

    def value(self, learner: LearnerState, normalized: jax.Array) -> jax.Array:
        """Values [..., K] in return units for normalised observations [..., O]."""
        output = self.output(learner.critic, normalized)
        return output if learner.popart is None else popart.denormalize(learner.popart, output)


def make_actor_critic(env: Environment, config: NetworkConfig) -> ActorCritic:
    """Networks of the sizes that the environment and the settings give."""
    outputs = env.action_size * (1 if config.initial_std is None else 2)
    return ActorCritic(
        actor=_network(env, config, outputs, ACTOR_OUTPUT_SCALE),
        critic=_network(env, config, env.num_objectives, 1.0),
        observation_size=env.observation_size,
        initial_std=config.initial_std,
    )


def _network(env: Environment, config: NetworkConfig, outputs: int, scale: float) -> Network:
    """With a GRU in front where the environment's observation starts with frames."""
    shape = (config.hidden_sizes, outputs, config.activation, scale)
    frames: tuple[int, int] | None = getattr(env, "frames", None)
    return MLP(*shape) if frames is None else HistoryMLP(*frames, config.gru_size, *shape)


def normalized(policy: PolicyState, observation: jax.Array) -> jax.Array:
    """Raw observations [..., O] as the networks see them."""
    if policy.statistics is None:
        return observation
    return normalize.normalize(policy.statistics, observation)


def observe(policy: PolicyState, observation: jax.Array) -> PolicyState:
    """The policy with raw observations [..., O] added to its statistics."""
    if policy.statistics is None:
        return policy
    statistics = normalize.update(policy.statistics, observation)
    return dataclasses.replace(policy, statistics=statistics)
