"""The multilayer perceptron of the actor and the critic."""

from __future__ import annotations

import math
from collections.abc import Callable

import jax
from flax import linen as nn

# The last layer's name: PopArt looks it up to rescale it.
OUTPUT_LAYER = "output"

ACTIVATIONS: dict[str, Callable[[jax.Array], jax.Array]] = {
    "relu": nn.relu,
    "tanh": nn.tanh,
    "elu": nn.elu,
    "silu": nn.silu,
    "relu6": nn.relu6,
}


class MLP(nn.Module):
    """Dense layers with orthogonal kernels and zero biases: [..., I] to [..., output_size].

    `output_scale` is the gain of the last kernel. A small one makes an actor start near a zero
    mean, whatever it sees; 1 is usual for a critic (Andrychowicz et al. 2021, section 3.2).
    """

    hidden_sizes: tuple[int, ...]
    output_size: int
    activation: str = "relu"  # a key of ACTIVATIONS
    output_scale: float = 1.0

    @nn.compact
    def __call__(self, x: jax.Array) -> jax.Array:
        """The outputs [..., output_size] for inputs x[..., I]; no activation after the last."""
        return dense_layers(
            x, self.hidden_sizes, self.output_size, self.activation, self.output_scale
        )


def dense_layers(
    x: jax.Array,
    hidden_sizes: tuple[int, ...],
    output_size: int,
    activation: str = "relu",
    output_scale: float = 1.0,
) -> jax.Array:
    """The layers of an `MLP`, made inside the module that calls this."""
    nonlinear = ACTIVATIONS[activation]
    hidden_init = nn.initializers.orthogonal(math.sqrt(2.0))
    for index, size in enumerate(hidden_sizes):
        x = nonlinear(nn.Dense(size, kernel_init=hidden_init, name=f"hidden_{index}")(x))
    output_init = nn.initializers.orthogonal(output_scale)
    return nn.Dense(output_size, kernel_init=output_init, name=OUTPUT_LAYER)(x)
