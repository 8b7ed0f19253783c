"""The trained pose prior as the task uses it: latent units to natural poses [P 3.4, 3.5]."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from getup_jax.networks.mlp import OUTPUT_LAYER
from getup_jax.pose_prior.cvae import CONDITION_SIZE, CVAE

# Of N(0, 1), the distribution that the KL term draws each latent dimension to. A collapsed
# dimension has means near 0 that vary by noise only; dividing by that would make actions of noise.
MIN_LATENT_STD = 0.05


@struct.dataclass
class PosePrior:
    """A frozen CVAE and the scale of its latent; restores from a dict of arrays alone."""

    variables: dict[str, Any]  # of the CVAE: parameters and statistics
    latent_mean: jax.Array  # [Z] of the encoded training poses
    latent_std: jax.Array  # [Z] at least MIN_LATENT_STD
    joint_lower: jax.Array  # [J] rad
    joint_upper: jax.Array  # [J] rad

    @property
    def latent_size(self) -> int:
        """Z."""
        return self.latent_mean.shape[-1]

    @property
    def num_joints(self) -> int:
        """J."""
        return self.joint_lower.shape[-1]

    @property
    def mirrored(self) -> bool:
        """Whether the mirror image of a latent decodes to the mirror image of its pose."""
        return "mirror" in self.variables


_FIELDS = tuple(field.name for field in dataclasses.fields(PosePrior))


def decode(prior: PosePrior, latent: jax.Array, condition: jax.Array) -> jax.Array:
    """Joint angles [..., J] (rad) of latents [..., Z] under the condition [..., 3].

    Not clipped to the joint limits: the task limits its targets after it has added the offsets.
    """
    chex.assert_axis_dimension(latent, -1, prior.latent_size)
    chex.assert_axis_dimension(condition, -1, CONDITION_SIZE)
    angles: Any = network(prior).apply(prior.variables, latent, condition, method="decode")
    return angles


def encode(prior: PosePrior, angles: jax.Array, condition: jax.Array) -> jax.Array:
    """Latent mean [..., Z] of joint angles [..., J] (rad) with features [..., 3]."""
    mean, _ = posterior(prior, angles, condition)
    return mean


def posterior(
    prior: PosePrior, angles: jax.Array, condition: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Latent mean and log variance [..., Z] of joint angles [..., J] with features [..., 3]."""
    moments: Any = network(prior).apply(prior.variables, angles, condition, method="encode")
    return moments


def decode_action(prior: PosePrior, action: jax.Array, condition: jax.Array) -> jax.Array:
    """Joint angles [..., J] of an action's latent part [..., Z], in units of the latent's std.

    z = action * latent_std + latent_mean, so that zero is the mean pose and a normal action of
    unit variance explores the poses of the data (Yin et al. 2021).
    """
    return decode(prior, action * prior.latent_std + prior.latent_mean, condition)


def encode_action(prior: PosePrior, angles: jax.Array, condition: jax.Array) -> jax.Array:
    """The action's latent part [..., Z] whose decoded pose is nearest to the angles [..., J]."""
    return (encode(prior, angles, condition) - prior.latent_mean) / prior.latent_std


def network(prior: PosePrior) -> CVAE:
    """The module that the prior's variables belong to, read off their shapes."""
    decoder = prior.variables["params"]["decoder"]
    hidden = [decoder[f"hidden_{i}"]["bias"].shape[0] for i in range(len(decoder) - 1)]
    inputs = decoder["hidden_0" if hidden else OUTPUT_LAYER]["kernel"].shape[0]
    return CVAE(
        num_joints=prior.num_joints,
        latent_size=prior.latent_size,
        hidden_sizes=tuple(hidden),
        conditional=inputs == prior.latent_size + CONDITION_SIZE,
        mirrored=prior.mirrored,
    )


def to_dict(prior: PosePrior) -> dict[str, Any]:
    """The prior as nested dicts of NumPy arrays, for checkpoints."""
    return jax.tree.map(np.asarray, {name: getattr(prior, name) for name in _FIELDS})


def from_dict(state: Mapping[str, Any]) -> PosePrior:
    """The prior that `to_dict` wrote; raises ValueError where a part is missing or unknown."""
    if set(state) != set(_FIELDS):
        raise ValueError(f"pose prior: expected {sorted(_FIELDS)}, got {sorted(state)}")
    return PosePrior(**jax.tree.map(jnp.asarray, dict(state)))


def from_checkpoint(state: Mapping[str, Any] | None) -> PosePrior | None:
    """The prior of a checkpoint's policy; None where it was trained without one."""
    return None if state is None else from_dict(state)
