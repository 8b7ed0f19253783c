"""A multilayer perceptron that is equivariant to mirror images by construction.

    f(M x) = M' f(x)

Hidden units come in pairs that change places in the mirror image (the regular representation of the
group of two elements). A linear map commutes with the images exactly where it maps symmetric parts
to symmetric ones and antisymmetric parts to antisymmetric ones, so in these coordinates a layer is
two blocks: half of the weights, and of the work, of a dense layer of the same size (Ravanbakhsh et
al. 2017, Equivariance through parameter-sharing; Finzi et al. 2021, A practical method for
constructing equivariant multilayer perceptrons).
"""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import linen as nn

from getup_jax.core.mirror import SignedPermutation
from getup_jax.networks.mlp import ACTIVATIONS, OUTPUT_LAYER

_HALF = math.sqrt(0.5)


class EquivariantMLP(nn.Module):
    """As `MLP`, [..., I] to [..., size of image_out], with hidden layers of pairs.

    A hidden size that is odd is rounded up. The antisymmetric part has no biases.
    """

    hidden_sizes: tuple[int, ...]
    image_in: SignedPermutation  # [I]; an offset is allowed
    image_out: SignedPermutation  # without an offset
    activation: str = "relu"  # a key of ACTIVATIONS
    output_scale: float = 1.0

    @nn.compact
    def __call__(self, x: jax.Array) -> jax.Array:
        """The outputs for inputs x[..., I]; no activation after the last layer."""
        nonlinear = ACTIVATIONS[self.activation]
        even, odd = _parts_around(self.image_in, x)
        init = nn.initializers.orthogonal(math.sqrt(2.0))
        for index, size in enumerate(self.hidden_sizes):
            pairs, name = (size + 1) // 2, f"hidden_{index}"
            even = nn.Dense(pairs, kernel_init=init, name=name)(even)
            odd = nn.Dense(pairs, kernel_init=init, use_bias=False, name=f"{name}_odd")(odd)
            left, right = _turned(even, odd)
            even, odd = _turned(nonlinear(left), nonlinear(right))
        init = nn.initializers.orthogonal(self.output_scale)
        evens, odds = sizes(self.image_out)
        even = nn.Dense(evens, kernel_init=init, name=OUTPUT_LAYER)(even)
        if odds == 0:  # such as values
            return joined(self.image_out, even, even[..., :0])
        odd = nn.Dense(odds, kernel_init=init, use_bias=False, name=f"{OUTPUT_LAYER}_odd")(odd)
        return joined(self.image_out, even, odd)


def dense(network: EquivariantMLP, variables: Any) -> dict[str, Any]:
    """The variables of an `MLP` of the same sizes that computes the same.

    It is equivariant as long as nobody trains it. Raises ValueError for a hidden size that is odd.
    """
    if any(size % 2 for size in network.hidden_sizes):
        raise ValueError(f"hidden_sizes: expected even ones, got {network.hidden_sizes}")
    params, layers = variables["params"], {}
    hidden = [f"hidden_{index}" for index in range(len(network.hidden_sizes))]
    size = network.image_in.size
    for number, name in enumerate([*hidden, OUTPUT_LAYER]):
        # a layer is affine: its bias is what it makes of zeros, its kernel of the unit vectors
        with jax.default_matmul_precision("highest"):
            rows = _layer(network, params, name, number == 0, jnp.eye(size + 1, size, -1))
        layers[name] = {"kernel": rows[1:] - rows[0], "bias": rows[0]}
        size = rows.shape[-1]
    return {"params": layers}


def _layer(
    network: EquivariantMLP, params: Any, name: str, is_first: bool, x: jax.Array
) -> jax.Array:
    """[..., H] of one layer before its activation, pairs as (all first ones, all second ones)."""
    if is_first:
        even, odd = _parts_around(network.image_in, x)
    else:
        even, odd = _turned(*jnp.split(x, 2, axis=-1))
    even = even @ params[name]["kernel"] + params[name]["bias"]
    kernel = params.get(f"{name}_odd", {"kernel": jnp.zeros((odd.shape[-1], 0))})["kernel"]
    odd = odd @ kernel
    if name == OUTPUT_LAYER:
        return joined(network.image_out, even, odd)
    return jnp.concatenate(_turned(even, odd), axis=-1)


def _turned(a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The two units of pairs from their coordinates, and these from those: its own inverse."""
    return _HALF * (a + b), _HALF * (a - b)


def _parts_around(image: SignedPermutation, x: jax.Array) -> tuple[jax.Array, jax.Array]:
    """`parts` of what x [..., N] is beside the point that is its own image: M is linear there."""
    return parts(image, x if image.offset is None else x - 0.5 * jnp.asarray(image.offset))


def sizes(image: SignedPermutation) -> tuple[int, int]:
    """How many symmetric and antisymmetric coordinates vectors [N] have; N together."""
    _, alone, sign = _pairs(image)
    return int((~alone | (sign > 0)).sum()), int((~alone | (sign < 0)).sum())


def parts(image: SignedPermutation, x: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The symmetric [..., E] and antisymmetric [..., D] coordinates of x[..., N]; orthonormal.

    (x + M x) / 2 and (x - M x) / 2 without what is twice there; an offset does not count.
    """
    first, alone, sign = _pairs(image)
    second = np.asarray(image.index)[first]
    found = []
    for wanted in (1.0, -1.0):
        kept = ~alone | (sign == wanted)
        scale = np.where(alone, 0.5, _HALF)[kept].astype(np.float32)
        turned = (wanted * sign[kept]).astype(np.float32)
        found.append(scale * (x[..., first[kept]] + turned * x[..., second[kept]]))
    return found[0], found[1]


def joined(image: SignedPermutation, even: jax.Array, odd: jax.Array) -> jax.Array:
    """x[..., N] of its coordinates; undoes `parts`."""
    first, alone, sign = _pairs(image)
    second = np.asarray(image.index)[first]
    evens = even.shape[-1]
    # Of each number: the even and the odd coordinate that it is made of, and their factors.
    place, factor = np.zeros((2, image.size), int), np.zeros((2, image.size), np.float32)
    for row, wanted in enumerate((1.0, -1.0)):
        kept = np.flatnonzero(~alone | (sign == wanted))
        for slot, pair in enumerate(kept):
            a, b = first[pair], second[pair]
            place[row, [a, b]] = slot + row * evens
            factor[row, b] = wanted * sign[pair] * _HALF
            factor[row, a] = 1.0 if alone[pair] else _HALF
    both = jnp.concatenate([even, odd], axis=-1)
    used = factor[1].any()
    x = factor[0] * both[..., place[0]]
    return x + factor[1] * both[..., place[1]] if used else x


def _pairs(image: SignedPermutation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every pair of numbers once [P]: the first one, whether it is its own image, and the sign."""
    index = np.asarray(image.index)
    first = np.flatnonzero(np.arange(image.size) <= index)
    return first, index[first] == first, np.asarray(image.sign)[first]
