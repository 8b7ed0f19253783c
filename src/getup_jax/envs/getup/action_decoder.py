"""What an action of the get-up task means: a latent pose and an offset for every hinge [P 3.4]."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import TaskConfig
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.pose_prior.prior import PosePrior


@dataclasses.dataclass(frozen=True, eq=False)
class ActionDecoder:
    """From actions to servo targets, q = decoder(z, c) + scale * offset, and back."""

    prior: PosePrior | None  # None: offsets alone, from `neutral`
    offset_scale: float  # rad of an offset of 1
    neutral: jax.Array | None = None  # [J] rad; only without a prior

    @property
    def latent_size(self) -> int:
        """Z, the first numbers of an action."""
        return 0 if self.prior is None else self.prior.latent_size

    def pose(self, action: jax.Array, condition: jax.Array) -> jax.Array:
        """Hinge angles [..., J] (rad) that the latent parts of actions [..., A] stand for.

        condition [..., 3]: the curve values at that time.
        """
        if self.prior is None:
            assert self.neutral is not None
            return jnp.broadcast_to(self.neutral, (*action.shape[:-1], self.neutral.size))
        return pose_prior.decode_action(self.prior, action[..., : self.latent_size], condition)

    def target(self, action: jax.Array, condition: jax.Array) -> jax.Array:
        """Servo target [..., J] (rad), not clipped, of actions [..., A] under curves [..., 3]."""
        offset = action[..., self.latent_size :]
        return self.pose(action, condition) + self.offset_scale * offset

    def action(self, pose: jax.Array, target: jax.Array, condition: jax.Array) -> jax.Array:
        """The action [..., A] with that target [..., J], its latent being the one of `pose`."""
        latent = self.latent(pose, condition)
        if self.offset_scale == 0:  # offsets do nothing
            return jnp.concatenate([latent, jnp.zeros_like(target)], axis=-1)
        rest = target - self.pose(latent, condition)
        return jnp.concatenate([latent, rest / self.offset_scale], axis=-1)

    def nearest(self, angles: jax.Array, condition: jax.Array) -> jax.Array:
        """The action [..., A] whose target is the pose angles [..., J], as near as latents get.

        Exactly, by offsets, where there is no prior; by the latent pose alone where there is one.
        """
        if self.prior is None:
            return self.action(angles, angles, condition)
        latent = self.latent(angles, condition)
        return jnp.concatenate([latent, jnp.zeros_like(angles)], axis=-1)

    def first(
        self, config: TaskConfig, flat: bool, angles: jax.Array, condition: jax.Array
    ) -> jax.Array:
        """The action [..., A] that a start's filter holds, for its pose angles [..., J].

        The prior knows no feet turned to a slope, nor limp bodies: without offsets, the servos
        would push the former over and throw the latter about. With all of them the reward of limp
        bodies would be 0 at first, see `rewards.natural`.
        """
        if config.limp_share > 0:
            return self.hold(angles, condition, config.offset_limit_rad)
        if flat:
            return self.nearest(angles, condition)
        return self.action(angles, angles, condition)

    def hold(self, angles: jax.Array, condition: jax.Array, most_rad: float) -> jax.Array:
        """The action [..., A] whose target is the pose angles [..., J], or near it.

        By latent pose and offsets. With a prior, these are scaled down where their sum |dq|_1 would
        exceed most_rad.
        """
        exact = self.action(angles, angles, condition)
        if self.prior is None:
            return exact
        latent, offset = exact[..., : self.latent_size], exact[..., self.latent_size :]
        total = self.offset_scale * jnp.abs(offset).sum(axis=-1, keepdims=True)
        share = most_rad / jnp.maximum(total, most_rad)
        return jnp.concatenate([latent, share * offset], axis=-1)

    def latent(self, angles: jax.Array, condition: jax.Array) -> jax.Array:
        """The latent parts [..., Z] that the prior encodes poses [..., J] by."""
        if self.prior is None:
            return angles[..., :0]
        return pose_prior.encode_action(self.prior, angles, condition)

    def translate(self, action: jax.Array, condition: jax.Array, new: ActionDecoder) -> jax.Array:
        """Another decoder's action [..., A'] that has the servo target of this one [..., A]."""
        return new.action(self.pose(action, condition), self.target(action, condition), condition)

    def same(self, other: ActionDecoder) -> bool:
        """Whether an action means the same in both."""
        if self.offset_scale != other.offset_scale:
            return False
        ours, theirs = (jax.tree.leaves(_arrays(decoder)) for decoder in (self, other))
        return len(ours) == len(theirs) and all(map(np.array_equal, ours, theirs))


def _arrays(decoder: ActionDecoder) -> object:
    return decoder.neutral if decoder.prior is None else pose_prior.to_dict(decoder.prior)
