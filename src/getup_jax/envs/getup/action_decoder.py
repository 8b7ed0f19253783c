"""What an action of the get-up task means: a latent pose and an offset for every hinge [P 3.4]."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

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
        return self.pose(action, condition) + self.offset(action)

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

    def first(self, angles: jax.Array, condition: jax.Array) -> jax.Array:
        """The action [..., A] that a start's filter holds: its target is the pose angles [..., J].

        By offsets too, as the prior knows no feet turned to a slope, nor limp bodies, noise on the
        hinges or other people's motions: its own pose nearest to theirs would make the servos push
        the first over, and throw the others about with half of the hinges at the torque limit.
        """
        return self.action(angles, angles, condition)

    def begin(
        self, angles: jax.Array, condition: jax.Array, given: jax.Array | None
    ) -> tuple[jax.Array, jax.Array | None]:
        """What the filters of starts [B] hold: actions [B, A], and offsets [B, J] (rad) of theirs.

        given [B, A]: actions that come with the starts, NaN where none does; None: with no start.
        The offsets are those that nobody asked for, since they hold the pose alone, see `first`;
        None: without a prior, where no offset is unnatural.
        """
        action = self.first(angles, condition)
        unasked = None if self.prior is None else self.offset(action)
        if given is None:
            return action, unasked
        none = jnp.isnan(given)
        if unasked is not None:
            unasked = jnp.where(none[:, -1:], unasked, 0.0)
        return jnp.where(none, action, given), unasked

    def offset(self, action: jax.Array) -> jax.Array:
        """The offsets [..., J] (rad) in actions [..., A]."""
        return self.offset_scale * action[..., self.latent_size :]

    def asked(self, action: jax.Array, start_offset: jax.Array | None) -> jax.Array:
        """Those of filtered actions [..., A] that were asked for: without what `begin` left.

        start_offset [..., J] (rad): that; None: there is none.
        """
        offset = self.offset(action)
        return offset if start_offset is None else offset - start_offset

    def latent(self, angles: jax.Array, condition: jax.Array) -> jax.Array:
        """The latent parts [..., Z] that the prior encodes poses [..., J] by."""
        if self.prior is None:
            return angles[..., :0]
        return pose_prior.encode_action(self.prior, angles, condition)

    def translate(self, action: jax.Array, condition: jax.Array, new: ActionDecoder) -> jax.Array:
        """Another decoder's action [..., A'] that has the servo target of this one [..., A].

        The same action where it means the same there: poses encoded anew have other latents.
        """
        if self.same(new):
            return action
        return new.action(self.pose(action, condition), self.target(action, condition), condition)

    def same(self, other: ActionDecoder) -> bool:
        """Whether an action means the same in both."""
        if self.offset_scale != other.offset_scale:
            return False
        ours, theirs = (jax.tree.leaves(_arrays(decoder)) for decoder in (self, other))
        return len(ours) == len(theirs) and all(map(np.array_equal, ours, theirs))


def _arrays(decoder: ActionDecoder) -> object:
    return decoder.neutral if decoder.prior is None else pose_prior.to_dict(decoder.prior)
