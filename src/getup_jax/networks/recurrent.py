"""A GRU over a few frames, and the networks that see a history through it [C 6.1, figure 3]."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import linen as nn

from getup_jax.networks.mlp import dense_layers


class GRU(nn.Module):
    """Gated recurrent unit (Chung et al. 2014): frames x[..., F, I] to the last state [..., H].

        r, z = sigmoid(W x + U h + b)    n = tanh(W x + b + r (U h + c))    h' = (1 - z) n + z h

    The first state is zero. The inputs of all frames are multiplied at once, and the few steps
    are written out, since a loop over them costs more than they do.
    """

    size: int  # H

    @nn.compact
    def __call__(self, x: jax.Array) -> jax.Array:
        """The state after the last frame."""
        size = self.size
        inputs = nn.Dense(3 * size, name="input", kernel_init=nn.initializers.lecun_normal())(x)
        recurrent = nn.Dense(3 * size, name="recurrent", kernel_init=nn.initializers.orthogonal())
        # one zero state for all rows: its product with the weights is not computed for each
        hidden = jnp.zeros(size, x.dtype)
        for frame in range(x.shape[-2]):
            now, before = inputs[..., frame, :], recurrent(hidden)
            gates = nn.sigmoid(now[..., : 2 * size] + before[..., : 2 * size])
            reset, update = gates[..., :size], gates[..., size:]
            new = nn.tanh(now[..., 2 * size :] + reset * before[..., 2 * size :])
            hidden = (1.0 - update) * new + update * hidden
        return hidden


class HistoryMLP(nn.Module):
    """A GRU over the frames at the head of the input, its state and the rest through an `MLP`.

    With several outputs (a critic of K heads) the history is encoded once for all of them.
    """

    num_frames: int  # F
    frame_size: int  # I, the input starts with F * I numbers, the oldest frame first
    gru_size: int
    hidden_sizes: tuple[int, ...]
    output_size: int
    activation: str = "relu"
    output_scale: float = 1.0

    @nn.compact
    def __call__(self, x: jax.Array) -> jax.Array:
        """The outputs [..., output_size] for inputs x[..., F * I + G]."""
        length = self.num_frames * self.frame_size
        frames = x[..., :length].reshape(*x.shape[:-1], self.num_frames, self.frame_size)
        state = GRU(self.gru_size, name="gru")(frames)
        x = jnp.concatenate([state, x[..., length:]], axis=-1)
        return dense_layers(
            x, self.hidden_sizes, self.output_size, self.activation, self.output_scale
        )
