"""From experience to samples: values, advantages and targets of one rollout."""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp

from getup_jax.config import PPOConfig
from getup_jax.core.masked_update import replace_rows
from getup_jax.rl import popart, ppo
from getup_jax.rl.actor_critic import ActorCritic, normalized
from getup_jax.rl.gae import gae
from getup_jax.rl.ppo import Samples
from getup_jax.rl.rollout import Transition
from getup_jax.rl.state import LearnerState

_TRUNCATED_CHUNK = 128  # truncated steps whose values are computed at once


def estimate(
    model: ActorCritic,
    learner: LearnerState,
    transition: Transition,
    config: PPOConfig,
    discount: float | jax.Array,
) -> tuple[LearnerState, Samples, jax.Array]:
    """Score a rollout of [T, B] steps, with one discount or [K] of the objectives.

    Returns:
        The learner, with PopArt moved to the new targets where it is used; samples [T * B, ...];
        and the explained variance of the values that the rollout was scored with, a scalar.
    """
    observation = normalized(learner.policy, transition.observation)
    value = model.value(learner, observation)
    following = next_values(model, learner, transition, value)
    ends = transition.terminated, transition.truncated
    estimated = functools.partial(gae, transition.reward, value, following, *ends, discount)
    advantage, target = estimated(config.gae_lambda)
    if config.critic_lambda is not None:
        _, target = estimated(config.critic_lambda)
    explained = ppo.explained_variance(value, target)
    learner, target = normalize_targets(learner, target)
    samples = Samples(
        observation=observation,
        action=transition.action,
        log_prob=transition.log_prob,
        advantage=ppo.standardize(advantage),
        target=target,
    )
    return learner, jax.tree.map(_flatten, samples), explained


def next_values(
    model: ActorCritic, learner: LearnerState, transition: Transition, value: jax.Array
) -> jax.Array:
    """Values [T, B, K] of the observations that the steps reached, before any reset.

    An episode that goes on reaches what the next step starts from, whose value [T, B, K] is known
    but for the last step. The critic sees only that and the few truncated steps' observations;
    where an episode terminated, no next value is read and the result is any number.
    """

    def critic(raw: jax.Array) -> jax.Array:
        return model.value(learner, normalized(learner.policy, raw))

    final = transition.final_observation
    following = jnp.concatenate([value[1:], critic(final[-1])[None]])
    flat = _flatten(final)
    truncated = transition.truncated.reshape(-1)
    rows = replace_rows(
        _flatten(following), truncated, lambda index: critic(flat[index]), _TRUNCATED_CHUNK
    )
    return rows.reshape(value.shape)


def normalize_targets(learner: LearnerState, target: jax.Array) -> tuple[LearnerState, jax.Array]:
    """Value targets [..., K] in the critic's units; without PopArt those are return units."""
    if learner.popart is None:
        return learner, target
    statistics = popart.update(learner.popart, target)
    critic = popart.rescale(learner.critic, learner.popart, statistics)
    optimiser = popart.rescale_moments(learner.critic_optimiser, learner.popart, statistics)
    learner = dataclasses.replace(
        learner, critic=critic, critic_optimiser=optimiser, popart=statistics
    )
    return learner, popart.normalize(statistics, target)


def _flatten(x: jax.Array) -> jax.Array:
    """[T, B, ...] to [T * B, ...]."""
    return x.reshape(-1, *x.shape[2:])
