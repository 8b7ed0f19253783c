"""What rewards that are learned must offer to the learner."""

from __future__ import annotations

from typing import Any, Protocol

import jax

from getup_jax.rl.rollout import Transition


class RewardModel(Protocol):
    """Rewards that are learned: trained on a rollout, they score it before values are estimated."""

    @property
    def critic_weights(self) -> tuple[float, ...]:
        """[K] of the critics' advantages."""
        ...

    def init(self, key: jax.Array) -> dict[str, Any]:
        """Fresh discriminators by name."""
        ...

    def score(
        self, world: Any, states: dict[str, Any], transition: Transition, key: jax.Array
    ) -> tuple[dict[str, Any], Transition, dict[str, jax.Array]]:
        """The discriminators after training, a rollout [T, B] with all rewards, and metrics."""
        ...
