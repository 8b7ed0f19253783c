"""Behaviour cloning in rounds, for demonstrations that come in meanwhile."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

from getup_jax.envs.getup.action_decoder import ActionDecoder
from getup_jax.imitation.action_regression import cloning_loss
from getup_jax.imitation.demonstrations import Demonstrations
from getup_jax.rl.learner import Learner
from getup_jax.rl.minibatch import Trainee, run_minibatches
from getup_jax.rl.state import PolicyState

PORTION = 50  # updates whose samples are on the device together; of a round, a multiple of these
_MINIBATCH = 2048
_LEARNING_RATES = 4e-4, 1e-5
_GRADIENT_NORM = 1.0  # at most


class IncrementalRegression:
    """The regression of `clone` with one optimiser for all rounds, its rate falling along a cosine.

    The first large steps of a fresh one would undo in each round what is learned already.
    """

    def __init__(
        self, learner: Learner, policy: PolicyState, decoder: ActionDecoder, updates: int
    ) -> None:
        """updates: of all rounds together."""
        first, last = _LEARNING_RATES
        rate = optax.cosine_decay_schedule(first, updates, last / first)
        optimiser = optax.chain(optax.clip_by_global_norm(_GRADIENT_NORM), optax.adam(rate))
        loss = cloning_loss(learner, policy, decoder)
        self._policy, self._carry = policy, (policy.actor, optimiser.init(policy.actor))

        @jax.jit
        def portion(carry: tuple[Any, Any], samples: Any) -> tuple[Any, Any]:
            order = jnp.arange(len(samples.target)).reshape(PORTION, -1)
            (trained,) = run_minibatches((Trainee(loss, optimiser, *carry, order),), samples)
            return trained[:2]

        self._portion = portion

    @property
    def policy(self) -> PolicyState:
        """As far as it has learned."""
        return dataclasses.replace(self._policy, actor=self._carry[0])

    def learn(
        self, demos: Sequence[Demonstrations], updates: int, rng: np.random.Generator
    ) -> None:
        """A multiple of PORTION updates by minibatches of random samples of all demonstrations."""
        if updates % PORTION or not any(len(part.target) for part in demos):
            raise ValueError(f"expected a multiple of {PORTION} updates and demonstrations")
        for _ in range(updates // PORTION):
            samples = _drawn(demos, PORTION * _MINIBATCH, rng)
            self._carry = self._portion(self._carry, samples)


def _drawn(demos: Sequence[Demonstrations], count: int, rng: np.random.Generator) -> Demonstrations:
    """Random ones of several batches, with replacement, without joining what may be gigabytes."""
    sizes = [len(part.target) for part in demos]
    ends = np.cumsum(sizes)
    rows = rng.integers(0, ends[-1], count)
    batch = np.searchsorted(ends, rows, side="right")
    drawn = jax.tree.map(lambda x: np.empty((count, *x.shape[1:]), x.dtype), demos[0])
    for number, (part, end, size) in enumerate(zip(demos, ends, sizes, strict=True)):
        here = batch == number
        for to, values in zip(jax.tree.leaves(drawn), jax.tree.leaves(part), strict=True):
            to[here] = values[rows[here] - (end - size)]
    return drawn
