"""Many objectives in one learner: discriminators give their rewards before values are estimated."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from getup_jax.config import CompositeConfig
from getup_jax.core import device_axis
from getup_jax.envs.composite.groups import Group, objective_weights
from getup_jax.envs.composite.reference_windows import likeness, sample
from getup_jax.envs.composite.task import CompositeTask
from getup_jax.rl.discriminator import Discriminator, DiscriminatorState
from getup_jax.rl.rollout import Transition

_DRAWN = 2  # folded into a key, so that runs that use all windows draw what they did


@dataclasses.dataclass(frozen=True)
class DiscriminatorRewards:
    """Names and weights of the objectives, the first of which are imitations [C 4.3]."""

    names: tuple[str, ...]  # [K]
    weights: tuple[float, ...]  # [K], their sum is 1
    groups: tuple[Group, ...]  # imitated; objective k is group k
    discriminator: Discriminator
    control_dt: float  # s between two frames of a window
    separate: bool  # a critic each; False: one for the weighted sum of their rewards

    @property
    def critic_weights(self) -> tuple[float, ...]:
        """Weights of the critics' advantages."""
        return self.weights if self.separate else (1.0,)

    def init(self, key: jax.Array) -> dict[str, DiscriminatorState]:
        """Fresh discriminators by group."""
        keys = jax.random.split(key, max(1, len(self.groups)))
        return {
            group.name: self.discriminator.init(key_group, group.num_frames, group.size)
            for group, key_group in zip(self.groups, keys, strict=False)
        }

    def score(
        self,
        world: Any,
        states: dict[str, DiscriminatorState],
        transition: Transition,
        key: jax.Array,
    ) -> tuple[dict[str, DiscriminatorState], Transition, dict[str, jax.Array]]:
        """Train the discriminators on a rollout [T, B], then score it with them.

        Returns the discriminators, the transition with every objective's reward, and metrics.
        """
        rewards, trained, metrics = transition.reward, {}, {}
        for index, group in enumerate(self.groups):
            key_group = jax.random.fold_in(key, index)
            key_sample, key_update = jax.random.split(key_group)
            windows = transition.extras[group.name]
            fake = self._some(windows.reshape(-1, *windows.shape[2:]), key_group)
            references = world.references[group.name]
            real = sample(references, group, key_sample, len(fake), self.control_dt)
            state, found = self.discriminator.update(states[group.name], fake, real, key_update)
            imitation = self.discriminator.score(state, windows)
            imitation = jnp.where(transition.terminated, rewards[..., index], imitation)
            rewards = rewards.at[..., index].set(imitation)
            trained[group.name] = state
            metrics |= {f"discriminator_{group.name}/{k}": v for k, v in found.items()}
            # of a rollout's last step alone: a distance to hundreds of poses is not cheap
            alike = likeness(references, group, windows[-1])
            metrics |= {f"rollout/{k}": device_axis.mean(v) for k, v in alike.items()}
        for index, name in enumerate(self.names):
            metrics[f"rollout/reward_{name}"] = device_axis.mean(rewards[..., index])
        return trained, dataclasses.replace(transition, reward=self._merged(rewards)), metrics

    def _some(self, windows: jax.Array, key: jax.Array) -> jax.Array:
        """The share of the windows [N, F, D] that an update learns from."""
        share = self.discriminator.config.share
        if share == 1.0:
            return windows
        order = jax.random.permutation(jax.random.fold_in(key, _DRAWN), len(windows))
        drawn = round(share * len(windows) * device_axis.size())  # on all devices together
        return windows[order[: device_axis.part(drawn)]]

    def _merged(self, rewards: jax.Array) -> jax.Array:
        """Rewards [T, B, K] as the critics have them."""
        if self.separate:
            return rewards
        return jnp.sum(jnp.asarray(self.weights) * rewards, axis=-1, keepdims=True)


def make_discriminator_rewards(env: CompositeTask, config: CompositeConfig) -> DiscriminatorRewards:
    """The objectives of a composite task."""
    return DiscriminatorRewards(
        names=env.objectives,
        weights=objective_weights(config, env.objectives),
        groups=env.groups,
        discriminator=Discriminator(config.discriminator),
        control_dt=env.engine.control_dt,
        separate=config.multi_objective,
    )
