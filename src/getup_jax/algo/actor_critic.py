"""The actor and the critic with the normalisation around them."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from getup_jax.algo import normalize, popart
from getup_jax.algo.state import LearnerState, PolicyState
from getup_jax.algo.update import make_optimiser
from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.nets.mlp import MLP
from getup_jax.types import Environment

# Gain of the actor's last kernel: the first actions are noise around zero.
ACTOR_OUTPUT_SCALE = 0.01


@dataclasses.dataclass(frozen=True)
class ActorCritic:
    """Two networks that share nothing but the normalised observation; variables are arguments."""

    actor: MLP  # to the mean action [A]
    critic: MLP  # to K outputs
    observation_size: int  # O

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
            optimiser=make_optimiser(config.max_gradient_norm, 0.0).init((actor, critic)),
            popart=popart.initial(self.critic.output_size) if config.popart else None,
            learning_rate_scale=jnp.ones((), jnp.float32),
        )

    def mean(self, actor: Any, normalized: jax.Array) -> jax.Array:
        """Mean actions [..., A] for normalised observations [..., O]."""
        mean: Any = self.actor.apply(actor, normalized)
        return mean

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
    shape = (config.hidden_sizes, env.action_size, config.activation)
    return ActorCritic(
        actor=MLP(*shape, output_scale=ACTOR_OUTPUT_SCALE),
        critic=MLP(config.hidden_sizes, env.num_objectives, config.activation),
        observation_size=env.observation_size,
    )


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
