"""The updates of one iteration: epochs of minibatches for the actor, and others for the critic.

Each has its own optimiser, rate, gradient limit and number of epochs. Only the actor's rate follows
its clip fraction: values that lag behind a policy that improves turn its advantages round, so what
slows the actor must not slow the critic.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from getup_jax.config import PPOConfig
from getup_jax.core import device_axis
from getup_jax.rl import ppo
from getup_jax.rl.actor_critic import ActorCritic
from getup_jax.rl.minibatch import (
    ACTOR_EPSILON,
    CRITIC_EPSILON,
    Trainee,
    adapt_scale,
    make_optimiser,
    run_minibatches,
    shuffled_minibatches,
)
from getup_jax.rl.state import LearnerState

COSINE_EVERY = 10  # iterations between two measurements of the gradient's noise
_CRITIC = 1  # folded into the key of the actor's minibatches

Metrics = dict[str, jax.Array]


@dataclasses.dataclass(frozen=True)
class Improver:
    """Networks and settings; samples and states are arguments."""

    model: ActorCritic
    config: PPOConfig
    weights: tuple[float, ...]  # [K] of the objectives, their sum is 1

    def update(
        self,
        learner: LearnerState,
        samples: ppo.Samples,
        rates: tuple[jax.Array, jax.Array],
        std: jax.Array,
        key: jax.Array,
    ) -> tuple[LearnerState, LearnerState, Metrics]:
        """The learner after the actor's epochs, and the learner after the critic's, apart.

        rates: learning rates of actor and critic. The first has the actor's next scale of its rate.
        """
        trainees = (
            self._actor(learner, rates[0], std, key),
            self._critic(learner, rates[1], jax.random.fold_in(key, _CRITIC)),
        )
        (actor, of_actor, metrics), (critic, of_critic, more) = run_minibatches(trainees, samples)
        metrics["ppo/gradient_norm"] = metrics.pop("gradient_norm")
        metrics["ppo/critic_gradient_norm"] = more.pop("gradient_norm")
        target = self.config.target_clip_fraction
        acted = dataclasses.replace(
            learner,
            policy=dataclasses.replace(learner.policy, actor=actor),
            actor_optimiser=of_actor,
            learning_rate_scale=adapt_scale(
                learner.learning_rate_scale, metrics["ppo/clip_fraction"], target
            ),
        )
        valued = dataclasses.replace(learner, critic=critic, critic_optimiser=of_critic)
        return acted, valued, metrics | more

    def _actor(
        self, learner: LearnerState, rate: jax.Array, std: jax.Array, key: jax.Array
    ) -> Trainee:
        config = self.config
        return Trainee(
            lambda actor, minibatch: self.actor_loss(actor, minibatch, std),
            make_optimiser(config.max_gradient_norm, rate, ACTOR_EPSILON),
            learner.policy.actor,
            learner.actor_optimiser,
            self._minibatches(key, config.epochs),
        )

    def _critic(self, learner: LearnerState, rate: jax.Array, key: jax.Array) -> Trainee:
        config = self.config
        return Trainee(
            self.critic_loss,
            make_optimiser(config.critic_gradient_norm, rate, CRITIC_EPSILON),
            learner.critic,
            learner.critic_optimiser,
            self._minibatches(key, config.critic_epochs),
        )

    def actor_loss(
        self, actor: Any, samples: ppo.Samples, std: jax.Array
    ) -> tuple[jax.Array, Metrics]:
        """PPO's loss of the actor on some samples, and what to log of it."""
        mean, std = self.model.distribution(actor, samples.observation, std)
        weights = jnp.asarray(self.weights, jnp.float32)
        terms, metrics = ppo.actor_terms(mean, samples, std, weights, self.config.clip)
        metrics["ppo/action_std"] = jnp.mean(std)
        return ppo.actor_loss(terms, self.config.entropy_coefficient), metrics

    def critic_loss(self, critic: Any, samples: ppo.Samples) -> tuple[jax.Array, Metrics]:
        """Mean squared error of the critic on some samples, in its own units."""
        loss = ppo.value_loss(self.model.output(critic, samples.observation), samples.target)
        return loss, {"loss/value": loss}

    def gradient_cosine(self, actor: Any, samples: ppo.Samples, std: jax.Array) -> jax.Array:
        """Cosine [] between the actor's gradients on two halves of the samples.

        1: a half says all that there is to learn; 0: noise alone. Samples of one episode stay
        together, since the simulations are split, so both halves are independent.
        """

        def gradient(half: ppo.Samples) -> Any:
            gradient = jax.grad(lambda actor: self.actor_loss(actor, half, std)[0])(actor)
            return device_axis.averaged(gradient)

        return cosine(*(gradient(half) for half in self._halves(samples)))

    def _halves(self, samples: ppo.Samples) -> tuple[ppo.Samples, ppo.Samples]:
        """Samples [T * B, ...] of the first and of the other simulations, of each device's."""
        steps, envs = self.config.num_steps, device_axis.part(self.config.num_envs)

        def half(x: jax.Array, part: slice) -> jax.Array:
            rows = x.reshape(steps, envs, *x.shape[1:])[:, part]
            return rows.reshape(-1, *x.shape[1:])

        middle = max(1, envs // 2)
        first = jax.tree.map(lambda x: half(x, slice(0, middle)), samples)
        return first, jax.tree.map(lambda x: half(x, slice(envs - middle, envs)), samples)

    def _minibatches(self, key: jax.Array, epochs: int) -> jax.Array:
        config = self.config
        num_samples = device_axis.part(config.num_envs) * config.num_steps
        size = device_axis.part(config.minibatch_size)
        return shuffled_minibatches(key, epochs, num_samples, size)


def cosine(a: Any, b: Any) -> jax.Array:
    """Of the angle between two pytrees of arrays, taken as one vector each; NaN where one is 0."""

    def dot(x: Any, y: Any) -> jax.Array:
        products = jax.tree.map(lambda p, q: jnp.sum(p * q), x, y)
        return jnp.sum(jnp.stack(jax.tree.leaves(products)))

    length = jnp.sqrt(dot(a, a) * dot(b, b))
    return jnp.where(length > 0, dot(a, b) / jnp.where(length > 0, length, 1.0), jnp.nan)
