"""The actor and the critic with the normalisation around them.

Where the environment has a mirror image, both are equivariant by construction, see
networks/equivariant.py, and what the observations are normalised by are the statistics of
observations and images together.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
from flax import linen as nn

from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.core.mirror import SignedPermutation, Symmetry, concatenated, signed
from getup_jax.core.types import Environment
from getup_jax.networks.equivariant import EquivariantMLP
from getup_jax.networks.mlp import MLP
from getup_jax.networks.recurrent import HistoryMLP
from getup_jax.rl import normalize, popart
from getup_jax.rl.minibatch import ACTOR_EPSILON, first_scale, make_optimiser
from getup_jax.rl.state import LearnerState, PolicyState

# Gain of the actor's last kernel: the first actions are noise around zero.
ACTOR_OUTPUT_SCALE = 0.01

# Logit of the first weight of a meta policy's action: 0.88, so that learning starts near it.
META_LOGIT = 2.0

# Samples that the observations' statistics remember: after 100 M, those of what a curriculum opened
# last would hardly move them.
MEMORY_STEPS = 1e7

Network = MLP | HistoryMLP | EquivariantMLP


@dataclasses.dataclass(frozen=True)
class ActorCritic:
    """Two networks that share nothing but the normalised observation; variables are arguments."""

    actor: Network  # to the mean action [A]; with its log std [2 A] where `initial_std` is given
    critic: Network  # to K outputs
    observation_size: int  # O
    num_objectives: int  # K
    initial_std: float | None = None  # None: the std is a setting, not the actor's
    std_range: float = 2.0  # bounds of the actor's log std, in e-folds around the first one
    # A where the observation ends in a meta policy's action, which only the mean gets, else 0
    meta_size: int = 0
    symmetry: Symmetry | None = None  # of raw observations, to which the networks are equivariant

    def init(self, key: jax.Array, config: PPOConfig) -> LearnerState:
        """Fresh variables, and the statistics that the settings ask for."""
        key_actor, key_critic = jax.random.split(key)
        observation = jnp.zeros(self.observation_size, jnp.float32)
        actor = self.actor.init(key_actor, observation)
        critic = self.critic.init(key_critic, observation)
        optimiser = make_optimiser(config.max_gradient_norm, 0.0, ACTOR_EPSILON)
        normalized = config.normalize_observation
        statistics = normalize.initial(self.observation_size) if normalized else None
        return LearnerState(
            policy=self.symmetric(PolicyState(actor=actor, statistics=statistics)),
            critic=critic,
            average=actor,
            actor_optimiser=optimiser.init(actor),
            critic_optimiser=optimiser.init(critic),
            popart=popart.initial(self.num_objectives) if config.popart else None,
            learning_rate_scale=first_scale(config.target_clip_fraction),
        )

    def mean(self, actor: Any, normalized: jax.Array) -> jax.Array:
        """Mean actions [..., A] for normalised observations [..., O]."""
        return self.distribution(actor, normalized, jnp.zeros(()))[0]

    def distribution(
        self, actor: Any, normalized: jax.Array, std: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        """Mean [..., A] and std of the actions; `std` [A] is the setting where it is one.

        Else the actor gives the std, and `std` is what it is multiplied by.

        With a meta policy's action a, the mean is mu + w a (Xu et al. 2023, equation 10).
        """
        mean, log_std, weight = self._heads(actor, normalized)
        if weight is not None:
            mean = mean + weight * jax.lax.stop_gradient(normalized[..., self.observation_size :])
        if self.initial_std is None or log_std is None:
            return mean, std
        log_std = jnp.clip(log_std, -self.std_range, self.std_range) + math.log(self.initial_std)
        return mean, std * jnp.exp(log_std)

    def meta_weight(self, actor: Any, normalized: jax.Array) -> jax.Array | None:
        """The weights w [..., A] of a meta policy's action, in (0, 1); None without one."""
        return self._heads(actor, normalized)[2] if self.meta_size else None

    def _heads(
        self, actor: Any, normalized: jax.Array
    ) -> tuple[jax.Array, jax.Array | None, jax.Array | None]:
        """The actor's own mean, log std and meta weight [..., A]; None where it has none."""
        has_std, has_meta = self.initial_std is not None, self.meta_size > 0
        output: Any = self.actor.apply(actor, normalized[..., : self.observation_size])
        parts = jnp.split(output, 1 + has_std + has_meta, axis=-1)
        weight = nn.sigmoid(parts[-1] + META_LOGIT) if has_meta else None
        return parts[0], parts[1] if has_std else None, weight

    def output(self, critic: Any, normalized: jax.Array) -> jax.Array:
        """Critic outputs [..., K] in the critic's units for normalised observations [..., O]."""
        output: Any = self.critic.apply(critic, normalized[..., : self.observation_size])
        return output

    def symmetric(self, policy: PolicyState) -> PolicyState:
        """The policy with statistics [O] of the observations and their mirror images."""
        if self.symmetry is None or policy.statistics is None:
            return policy
        statistics = normalize.symmetric(policy.statistics, self.symmetry.observation)
        return dataclasses.replace(policy, statistics=statistics)

    def value(self, learner: LearnerState, normalized: jax.Array) -> jax.Array:
        """Values [..., K] in return units for normalised observations [..., O]."""
        output = self.output(learner.critic, normalized)
        return output if learner.popart is None else popart.denormalize(learner.popart, output)


def make_actor_critic(
    env: Environment, config: NetworkConfig, normalized: bool = True
) -> ActorCritic:
    """Networks of the sizes that the environment and the settings give.

    They are equivariant with `network.mirror` where the environment has a `symmetry`.

    normalized: whether the observations are, `ppo.normalize_observation`.
    """
    meta_size: int = getattr(env, "meta_size", 0)
    symmetry: Symmetry | None = getattr(env, "symmetry", None) if config.mirror else None
    heads = 1 + (config.initial_std is not None) + (meta_size > 0)
    actor_image = critic_image = None
    if symmetry is not None:
        action = symmetry.action
        actor_image = concatenated([action] + (heads - 1) * [action.unsigned()])
        critic_image = signed([1.0] * env.num_objectives)
    seen = None if symmetry is None else symmetry.observation
    if seen is not None and normalized:
        seen = seen.linear()  # the offset went with the statistics' mean

    def network(outputs: int, scale: float, image: SignedPermutation | None) -> Network:
        """With a GRU in front where the environment's observation starts with frames."""
        if seen is not None and image is not None:
            return EquivariantMLP(config.hidden_sizes, seen, image, config.activation, scale)
        shape = (config.hidden_sizes, outputs, config.activation, scale)
        frames: tuple[int, int] | None = getattr(env, "frames", None)
        return MLP(*shape) if frames is None else HistoryMLP(*frames, config.gru_size, *shape)

    return ActorCritic(
        actor=network(heads * env.action_size, ACTOR_OUTPUT_SCALE, actor_image),
        critic=network(env.num_objectives, 1.0, critic_image),
        observation_size=env.observation_size - meta_size,
        num_objectives=env.num_objectives,
        initial_std=config.initial_std,
        std_range=config.std_range,
        meta_size=meta_size,
        symmetry=symmetry,
    )


def normalized(policy: PolicyState, observation: jax.Array) -> jax.Array:
    """Raw observations [..., O] as the networks see them; a meta policy's action stays raw."""
    if policy.statistics is None:
        return observation
    size = policy.statistics.mean.size
    seen = normalize.normalize(policy.statistics, observation[..., :size])
    if observation.shape[-1] == size:
        return seen
    return jnp.concatenate([seen, observation[..., size:]], axis=-1)


def observe(
    policy: PolicyState, observation: jax.Array, symmetry: Symmetry | None = None
) -> PolicyState:
    """The policy with raw observations [..., O], and their images, added to its statistics."""
    if policy.statistics is None:
        return policy
    size = policy.statistics.mean.size
    mirror = None if symmetry is None else symmetry.observation
    seen = observation[..., :size]
    statistics = normalize.update(policy.statistics, seen, MEMORY_STEPS, mirror)
    return dataclasses.replace(policy, statistics=statistics)
