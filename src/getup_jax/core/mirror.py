"""Mirror images in the plane y = 0 as signed permutations with an offset.

    (M x)[i] = sign[i] x[index[i]] + offset[i],   M M x = x

A function f is equivariant if f(M x) = M f(x). Any f can be made so by averaging over both images,
(f(x) + M f(M x)) / 2, which leaves an equivariant one as it is. Both are computed in one call of f,
see `stacked` and `averaged`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

Array = np.ndarray | jax.Array

# Signs of one vector's numbers in the mirror image.
POLAR = (1.0, -1.0, 1.0)  # x y z of positions and velocities
AXIAL = (-1.0, 1.0, -1.0)  # x y z of angular velocities, which are pseudo-vectors
QUATERNION = (1.0, -1.0, 1.0, -1.0)  # w x y z


@dataclasses.dataclass(frozen=True, eq=False)
class SignedPermutation:
    """A mirror image of vectors of N numbers; it must be its own inverse."""

    index: Array  # [N] where each number of the image comes from
    sign: Array  # [N] 1 or -1
    offset: Array | None = None  # [N] added at last; None: zeros

    @property
    def size(self) -> int:
        """N."""
        return self.index.shape[0]

    def __call__(self, x: jax.Array) -> jax.Array:
        """The mirror images of x[..., N]."""
        image = x[..., self.index] * self.sign
        return image if self.offset is None else image + self.offset

    def linear(self) -> SignedPermutation:
        """Without the offset: how differences of such vectors are mirrored."""
        return SignedPermutation(self.index, self.sign)

    def unsigned(self) -> SignedPermutation:
        """The permutation alone: how standard deviations of such vectors are mirrored."""
        return SignedPermutation(self.index, np.ones(self.size, np.float32))

    def stacked(self, x: jax.Array) -> jax.Array:
        """x[..., N] and its mirror images, [2, ..., N]."""
        return jnp.stack([x, self(x)])

    def averaged(self, both: jax.Array) -> jax.Array:
        """(y + M y') / 2 [..., N] of outputs [2, ..., N], y for x and y' for its image."""
        return 0.5 * (both[0] + self(both[1]))

    def moments(self, mean: jax.Array, variance: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Mean and variance [N] of samples and their images together, given the samples' own.

        The variance is the mean of both and a quarter of the squared distance of their means.
        """
        image = self(mean)
        spread = 0.25 * (mean - image) ** 2
        return 0.5 * (mean + image), 0.5 * (variance + variance[self.index]) + spread


@dataclasses.dataclass(frozen=True, eq=False)
class Symmetry:
    """Of an environment: the image of an action in the image of a state gives the same reward."""

    observation: SignedPermutation  # [O] raw
    action: SignedPermutation  # [A]


def signed(sign: Sequence[float], offset: Sequence[float] | None = None) -> SignedPermutation:
    """Every number stays in its place: x * sign + offset."""
    shift = None if offset is None else np.array(offset, np.float32)
    return SignedPermutation(np.arange(len(sign)), np.array(sign, np.float32), shift)


def vectors(index: Sequence[int] | np.ndarray, one: SignedPermutation) -> SignedPermutation:
    """Of rows [R, N] in one vector [R * N]: row r of the image is the image of row index[r]."""
    rows = np.asarray(index)
    return SignedPermutation(
        (rows[:, None] * one.size + np.asarray(one.index)).reshape(-1),
        np.tile(one.sign, len(rows)),
        None if one.offset is None else np.tile(one.offset, len(rows)),
    )


def concatenated(parts: Sequence[SignedPermutation]) -> SignedPermutation:
    """Of vectors in one, in the order of the parts."""
    starts = np.cumsum([0, *(part.size for part in parts[:-1])])
    pairs = zip(parts, starts, strict=True)
    offset = [np.zeros(p.size, np.float32) if p.offset is None else p.offset for p in parts]
    return SignedPermutation(
        np.concatenate([np.asarray(part.index) + start for part, start in pairs]),
        np.concatenate([part.sign for part in parts]),
        None if all(p.offset is None for p in parts) else np.concatenate(offset),
    )


# Height (m), side and front angle (rad): the angle of the left side to up turns into the right's.
CURVE = signed((1.0, -1.0, 1.0), (0.0, np.pi, 0.0))


def latent(size: int) -> SignedPermutation:
    """Of the prior's latents [Z]: the first half stays, the second changes its sign."""
    return signed([1.0] * (size // 2) + [-1.0] * (size - size // 2))
