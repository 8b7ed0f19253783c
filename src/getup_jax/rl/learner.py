"""The learner: one iteration of PPO as a pure function of the world and the training state.

    rollout -> discriminators, and their rewards (composite motion) -> values and GAE of each
    objective -> value targets (PopArt) -> epochs of minibatches -> observation statistics

The statistics move last, so that rollout, values and updates of an iteration see the same ones.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.core import device_axis
from getup_jax.core.types import Environment
from getup_jax.networks import gaussian
from getup_jax.rl import ppo, schedule, weight_average
from getup_jax.rl.actor_critic import ActorCritic, make_actor_critic, normalized, observe
from getup_jax.rl.advantages import estimate
from getup_jax.rl.policy_update import COSINE_EVERY, Improver
from getup_jax.rl.reward_model import RewardModel
from getup_jax.rl.rollout import Rollout, Transition, rollout, summarize
from getup_jax.rl.state import LearnerState, PolicyState, TrainState, owned

# folded into keys, so that runs without them draw what they did
_REWARDS, _DISCRIMINATORS, _STAGGER = 2, 3, 4


@struct.dataclass
class Stage:
    """The scheduled settings of one iteration."""

    learning_rate: jax.Array  # [] of the actor, with the adapted scale
    critic_learning_rate: jax.Array  # []
    action_std: jax.Array  # [A]; where the actor gives the std, what it is multiplied by


@dataclasses.dataclass(frozen=True, eq=False)
class Learner:
    """Networks and settings; every array is in TrainState or `world`. See `make_learner`."""

    env: Environment
    model: ActorCritic
    config: PPOConfig
    weights: tuple[float, ...]  # [K] of the critics, their sum is 1
    total_steps: int  # samples of the whole run
    discounts: tuple[float, ...] | None = None  # [K] of the objectives; None: `config.discount`
    reward_model: RewardModel | None = None  # None: the environment gives all rewards

    @property
    def discount(self) -> float | jax.Array:
        """One of all objectives, or [K]."""
        return self.config.discount if self.discounts is None else jnp.asarray(self.discounts)

    def init(self, world: Any, key: jax.Array) -> TrainState:
        """The state before the first iteration."""
        key_environment, key_learner, key_run = jax.random.split(key, 3)
        state = TrainState(
            learner=self.init_learner(key_learner),
            environment=self.init_environment(world, key_environment, self.config.num_envs),
            key=key_run,
            iteration=jnp.zeros((), jnp.int32),
        )
        return owned(state)

    def init_environment(self, world: Any, key: jax.Array, num_envs: int) -> Any:
        """The environment's part of `init`, of any number of simulations."""
        environment = self.env.init(world, key, num_envs)
        # In lockstep, an iteration would see one phase of all episodes, and the next one another.
        stagger = getattr(self.env, "stagger", None)
        if stagger is None:
            return environment
        return stagger(environment, jax.random.fold_in(key, _STAGGER))

    def init_learner(self, key: jax.Array) -> LearnerState:
        """The learner's part of `init`; needs no world, so a checkpoint's form can be had alone."""
        learner = self.model.init(key, self.config)
        if self.reward_model is None:
            return learner
        states = self.reward_model.init(jax.random.fold_in(key, _DISCRIMINATORS))
        return dataclasses.replace(learner, discriminators=states)

    def iteration(self, world: Any, state: TrainState) -> tuple[TrainState, dict[str, jax.Array]]:
        """One iteration: T * B new samples; metrics are float32 scalars.

        Jit it once and donate the state: `jax.jit(learner.iteration, donate_argnums=1)`. For
        several devices see `sharded.py`.
        """
        return self.learn(world, state, self.collect(world, state))

    def collect(self, world: Any, state: TrainState) -> Rollout:
        """The first part of an iteration: T steps of all B simulations."""
        key_rollout, _ = jax.random.split(_iteration_key(state))
        return self._collect(world, state, self.stage(state), key_rollout)

    def learn(
        self, world: Any, state: TrainState, collected: Rollout
    ) -> tuple[TrainState, dict[str, jax.Array]]:
        """The rest of an iteration: all that is done with what `collect` gave."""
        key, stage = _iteration_key(state), self.stage(state)
        _, key_update = jax.random.split(key)
        learner, transition, of_rewards = self._rewarded(
            world, state.learner, collected.transition, jax.random.fold_in(key, _REWARDS)
        )
        learner, samples, explained = estimate(
            self.model, learner, transition, self.config, self.discount
        )
        learner, metrics = self._improve(state.iteration, learner, samples, stage, key_update)
        policy = observe(learner.policy, collected.transition.observation, self.model.symmetry)
        metrics |= {
            "ppo/explained_variance": explained,
            "ppo/learning_rate": stage.learning_rate,
        }
        metrics |= of_rewards
        state = TrainState(
            learner=dataclasses.replace(learner, policy=policy),
            environment=collected.environment,
            key=state.key,
            iteration=state.iteration + 1,
        )
        return state, metrics | summarize(collected)

    def act(self, policy: PolicyState, observation: jax.Array) -> jax.Array:
        """The mean action [..., A] for raw observations [..., O]; deterministic."""
        return self.model.mean(policy.actor, normalized(policy, observation))

    def meta_weight(self, policy: PolicyState, observation: jax.Array) -> jax.Array | None:
        """The weights [..., A] of a meta policy's action; None without one."""
        return self.model.meta_weight(policy.actor, normalized(policy, observation))

    def value(self, learner: LearnerState, observation: jax.Array) -> jax.Array:
        """Values [..., K] in return units for raw observations [..., O]."""
        return self.model.value(learner, normalized(learner.policy, observation))

    def stage(self, state: TrainState) -> Stage:
        """Learning rate and exploration of the iteration that starts from `state`."""
        config = self.config
        # In float32, since the samples of a long run overflow int32.
        share = config.num_envs * config.num_steps / self.total_steps
        progress = state.iteration.astype(jnp.float32) * share

        def scheduled(ends: tuple[float, ...]) -> jax.Array:
            return schedule.value(ends[0], ends[-1], config.stages, progress)

        std = config.action_std if self.model.initial_std is None else config.std_scale
        return Stage(
            learning_rate=scheduled(config.learning_rate) * state.learner.learning_rate_scale,
            critic_learning_rate=scheduled(config.critic_learning_rate),
            action_std=jnp.full(self.env.action_size, scheduled(std)),
        )

    def _collect(self, world: Any, state: TrainState, stage: Stage, key: jax.Array) -> Rollout:
        """T steps with noise around the mean action."""

        def policy(observation: jax.Array, key_action: jax.Array):
            policy = state.learner.policy
            mean, std = self.model.distribution(
                policy.actor, normalized(policy, observation), stage.action_std
            )
            action = gaussian.sample(key_action, mean, std)
            return action, gaussian.log_prob(action, mean, std)

        return rollout(self.env, world, state.environment, policy, key, self.config.num_steps)

    def _rewarded(
        self, world: Any, learner: LearnerState, transition: Transition, key: jax.Array
    ) -> tuple[LearnerState, Transition, dict[str, jax.Array]]:
        """The rollout with the rewards that only discriminators know."""
        if self.reward_model is None or learner.discriminators is None:
            return learner, transition, {}
        states, transition, metrics = self.reward_model.score(
            world, learner.discriminators, transition, key
        )
        return dataclasses.replace(learner, discriminators=states), transition, metrics

    def _improve(
        self,
        iteration: jax.Array,
        learner: LearnerState,
        samples: ppo.Samples,
        stage: Stage,
        key: jax.Array,
    ) -> tuple[LearnerState, dict[str, jax.Array]]:
        """The learner after all updates of critic and actor."""
        improver, std = self.improver, stage.action_std
        metrics = {"ppo/gradient_cosine": self._cosine(iteration, learner, samples, std)}
        rates = stage.learning_rate, stage.critic_learning_rate
        acted, valued, of_updates = improver.update(learner, samples, rates, std, key)
        if self.config.critic_first > 0:
            # A policy that was trained before meets a critic that knows nothing yet.
            acted = _select(iteration < self.config.critic_first, learner, acted)
        improved = dataclasses.replace(
            acted, critic=valued.critic, critic_optimiser=valued.critic_optimiser
        )
        improved = _unless_first(learner, self._averaged(iteration, improved))
        return improved, metrics | of_updates

    def _cosine(
        self, iteration: jax.Array, learner: LearnerState, samples: ppo.Samples, std: jax.Array
    ) -> jax.Array:
        """`Improver.gradient_cosine` in one of COSINE_EVERY iterations, else NaN."""
        return jax.lax.cond(
            iteration % COSINE_EVERY == 0,
            lambda: self.improver.gradient_cosine(learner.policy.actor, samples, std),
            lambda: jnp.asarray(jnp.nan, jnp.float32),
        )

    def _averaged(self, iteration: jax.Array, learner: LearnerState) -> LearnerState:
        """With the newest actor in the average of its weights."""
        updates = jnp.maximum(iteration - self.config.critic_first, 0)
        samples = self.config.num_envs * self.config.num_steps
        actor = weight_average.update(
            learner.average, learner.policy.actor, updates, samples, self.config.average_steps
        )
        return dataclasses.replace(learner, average=actor)

    @property
    def improver(self) -> Improver:
        """The updates, with this learner's networks and settings."""
        return Improver(self.model, self.config, self.weights)


def _iteration_key(state: TrainState) -> jax.Array:
    """Folded in, so that a run that resumes here draws what the unbroken one would have.

    Every device has its own.
    """
    return device_axis.own_key(jax.random.fold_in(state.key, state.iteration))


def _select(mask: jax.Array, a: LearnerState, b: LearnerState) -> LearnerState:
    """Learner a where mask [] is true, else b."""
    return jax.tree.map(lambda x, y: jnp.where(mask, x, y), a, b)


def _unless_first(learner: LearnerState, improved: LearnerState) -> LearnerState:
    """The improved learner, but the old one while there are no observation statistics yet.

    An update on raw observations is far off once they are normalised, so the first iteration of a
    run only collects statistics.
    """
    statistics = learner.policy.statistics
    if statistics is None:
        return improved
    return _select(statistics.count == 0, learner, improved)


def make_learner(
    env: Environment,
    network_config: NetworkConfig,
    ppo_config: PPOConfig,
    total_steps: int,
    weights: Sequence[float] | None = None,
    discounts: Sequence[float] | None = None,
    reward_model: RewardModel | None = None,
) -> Learner:
    """A learner for the environment.

    Args:
        env: the batch of episodes.
        network_config: of actor and critic.
        ppo_config: see `PPOConfig`.
        total_steps: samples of the whole run, for the schedules.
        weights: [K] of the critics, scaled here to a sum of 1; None: those of the reward model, or
            all the same.
        discounts: [K] of the objectives; None: `ppo.discount` for all.
        reward_model: of composite motion; None: the environment gives all rewards.
    """
    count = env.num_objectives
    if weights is None:
        weights = [1.0] * count if reward_model is None else reward_model.critic_weights
    weights = list(weights)
    if len(weights) != count or min(weights) < 0 or sum(weights) == 0:
        raise ValueError(f"weights: expected {count} of at least 0, not all 0, got {weights}")
    if discounts is not None and len(discounts) != count:
        raise ValueError(f"discounts: expected {count}, got {list(discounts)}")
    return Learner(
        env=env,
        model=make_actor_critic(env, network_config, ppo_config.normalize_observation),
        config=ppo_config,
        weights=tuple(w / math.fsum(weights) for w in weights),
        total_steps=total_steps,
        discounts=None if discounts is None else tuple(discounts),
        reward_model=reward_model,
    )
