"""Discriminators of motion: an ensemble over windows of frames [C 4.2; Xu and Karamouzas 2021]."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import linen as nn
from flax import struct

from getup_jax.config import DiscriminatorConfig
from getup_jax.core import device_axis
from getup_jax.networks.mlp import dense_layers
from getup_jax.networks.recurrent import GRU
from getup_jax.rl import normalize
from getup_jax.rl.minibatch import Trainee, run_minibatches, shuffled_minibatches
from getup_jax.rl.normalize import Moments


class Ensemble(nn.Module):
    """Windows x[..., F, D] to the outputs [..., N] of N discriminators that share their layers."""

    gru_size: int
    hidden_sizes: tuple[int, ...]
    heads: int  # N

    @nn.compact
    def __call__(self, x: jax.Array) -> jax.Array:
        """Positive where the window looks like the clips."""
        state = GRU(self.gru_size, name="gru")(x)
        return dense_layers(state, self.hidden_sizes, self.heads)


@struct.dataclass
class DiscriminatorState:
    """One ensemble's variables, and what a checkpoint keeps of its training."""

    variables: Any
    optimiser: Any
    statistics: Moments  # [D] of the frames, simulated and recorded alike


@struct.dataclass
class Pairs:
    """What an update learns from: N windows of either kind, and the shares of their mixtures."""

    fake: jax.Array  # [N, F, D] simulated
    real: jax.Array  # [N, F, D] of the clips
    share: jax.Array  # [N] in [0, 1]
    head: jax.Array  # [N] int32, the head that judges the mixture, where only one does


@dataclasses.dataclass(frozen=True)
class Discriminator:
    """The ensemble of one group; every array is in its state."""

    config: DiscriminatorConfig

    @property
    def model(self) -> Ensemble:
        """The network."""
        config = self.config
        return Ensemble(config.gru_size, config.hidden_sizes, config.heads)

    def init(self, key: jax.Array, num_frames: int, size: int) -> DiscriminatorState:
        """Fresh variables for windows [num_frames, size]."""
        variables = self.model.init(key, jnp.zeros((num_frames, size), jnp.float32))
        return DiscriminatorState(
            variables=variables,
            optimiser=self._optimiser().init(variables),
            statistics=normalize.initial(size),
        )

    def update(
        self, state: DiscriminatorState, fake: jax.Array, real: jax.Array, key: jax.Array
    ) -> tuple[DiscriminatorState, dict[str, jax.Array]]:
        """Statistics, then one pass over simulated and recorded windows [N, F, D]."""
        key_share, key_order = jax.random.split(key)
        seen = jnp.concatenate([fake, real]).reshape(-1, fake.shape[-1])
        statistics = normalize.update(state.statistics, seen)
        pairs = Pairs(
            fake=self._seen(statistics, fake),
            real=self._seen(statistics, real),
            share=jax.random.uniform(key_share, fake.shape[:1]),
            head=jnp.arange(len(fake), dtype=jnp.int32),  # rows are shuffled
        )
        size = device_axis.part(self.config.minibatch_size)
        rows = shuffled_minibatches(key_order, 1, len(fake), size)
        trainee = Trainee(self._loss, self._optimiser(), state.variables, state.optimiser, rows)
        ((variables, optimiser, metrics),) = run_minibatches((trainee,), pairs)
        return DiscriminatorState(variables, optimiser, statistics), metrics

    def score(self, state: DiscriminatorState, windows: jax.Array) -> jax.Array:
        """The reward [...] of windows [..., F, D]."""
        x = self._seen(state.statistics, windows)
        output: Any = self.model.apply(state.variables, x)
        return reward(output)

    def _seen(self, statistics: Moments, windows: jax.Array) -> jax.Array:
        return normalize.normalize(statistics, windows, self.config.least_std)

    def _optimiser(self) -> optax.GradientTransformation:
        return optax.adam(self.config.learning_rate)

    def _loss(self, variables: Any, pairs: Pairs) -> tuple[jax.Array, dict[str, jax.Array]]:
        def ensemble(x: jax.Array) -> jax.Array:
            output: Any = self.model.apply(variables, x)
            return output

        both = ensemble(jnp.concatenate([pairs.fake, pairs.real]))
        fake, real = jnp.split(both, 2)
        hinge = hinge_loss(fake, real)
        config = self.config
        some = max(1, round(config.penalty_share * len(fake)))  # of rows that are shuffled
        mixtures = jax.tree.map(lambda x: x[:some], pairs)
        penalty = gradient_penalty(
            ensemble, mixtures, each=config.penalty_of == "head", norm=config.gradient_norm
        )
        loss = hinge + config.gradient_penalty * penalty
        metrics = {
            "loss": loss,
            "penalty": penalty,
            "fake": jnp.mean(fake),
            "real": jnp.mean(real),
        }
        return loss, metrics


def hinge_loss(fake: jax.Array, real: jax.Array) -> jax.Array:
    """mean_n,heads max(0, 1 + D(fake)) + max(0, 1 - D(real)), of outputs [n, N] [C equation 2]."""
    return jnp.mean(nn.relu(1.0 + fake)) + jnp.mean(nn.relu(1.0 - real))


def gradient_penalty(
    ensemble: Callable[[jax.Array], jax.Array],
    pairs: Pairs,
    each: bool = False,
    norm: float = 1.0,
) -> jax.Array:
    """mean (|gradient of sum_heads D| / norm - 1)^2 at mixtures of the windows [C equation 2].

    The paper writes the penalty of each head; its authors' release takes the gradient of the sum
    of all heads, which is one gradient instead of N. With `each`, it is the paper's: a mixture
    is judged by one head, drawn at random, so that the mean is that over heads too. In the paper
    the norm is 1.
    """
    share = pairs.share[:, None, None]
    mixed = share * pairs.fake + (1.0 - share) * pairs.real

    def output(x: jax.Array) -> jax.Array:
        heads = ensemble(x)
        if not each:
            return jnp.sum(heads)
        rows = jnp.arange(len(heads))
        return jnp.sum(heads[rows, pairs.head % heads.shape[-1]])

    gradient = jax.grad(output)(mixed)
    # the root has no derivative at 0, where a fresh network of dead units could be
    length = jnp.sqrt(jnp.sum(jnp.square(gradient), axis=(1, 2)) + 1e-12)
    return jnp.mean(jnp.square(length / norm - 1.0))


def reward(output: jax.Array) -> jax.Array:
    """Equation 5 of [C]: mean over heads of clip(D, -1, 1), [...] of outputs [..., N]."""
    return jnp.mean(jnp.clip(output, -1.0, 1.0), axis=-1)
