"""What a meta policy sees of links that it has lost: them as they are in its own clips.

A walk falls within two seconds when an arm is held still. The arm's weight is not why: the walk
has never seen such an arm, and its legs do wrong things. So the links with new clips are shown to
it as they are in the states that its own episodes start in, at the moment when all other links
look most alike. The paper leaves open what s_meta in equation 10 is.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from getup_jax.core import quaternion
from getup_jax.envs.composite.link_frames import LINK_STATE


@struct.dataclass
class Substitution:
    """What a policy knows."""

    moments: jax.Array  # [P, FRAMES + 1, L, LINK_STATE] relative to the root, see `_relative`
    new: jax.Array  # [L] bool, links that it does not know as they are now


def make_substitution(history: jax.Array, new: np.ndarray) -> Substitution:
    """From the frames [P, FRAMES + 1, L, LINK_STATE] before its own starts (world frame)."""
    flat = np.unique(np.asarray(history).reshape(len(history), -1), axis=0)
    different = jnp.asarray(flat.reshape(-1, *history.shape[1:]))
    own = np.array(new)
    own[0] = False  # the root is where it is
    return Substitution(jax.jit(_relative)(different), jnp.asarray(own))


def substitute(known: Substitution, history: jax.Array) -> jax.Array:
    """The history [B, FRAMES + 1, L, LINK_STATE] (world frame) as the policy sees it.

    The moment is that with the least sum of squared distances (m) of the links that it knows, in
    all of the frames. A blend of moments would have links in places where none has them.
    """
    near = jnp.argmin(_distances(known, _relative(history)), axis=-1)
    place, turn, linear, angular = _split(known.moments[near])
    root_place, root_turn, root_linear, root_angular = _split(history[..., :1, :])
    root_turn = jnp.broadcast_to(root_turn, turn.shape)
    shown = jnp.concatenate(
        [
            root_place + quaternion.rotate(root_turn, place),
            quaternion.multiply(root_turn, turn),
            root_linear + quaternion.rotate(root_turn, linear),
            root_angular + quaternion.rotate(root_turn, angular),
        ],
        axis=-1,
    )
    return jnp.where(known.new[:, None], shown, history)


def _distances(known: Substitution, relative: jax.Array) -> jax.Array:
    """Squared distances [B, P] between histories and moments: |a|^2 - 2 a b + |b|^2."""

    def features(x: jax.Array) -> jax.Array:
        return jnp.where(known.new[:, None], 0.0, x[..., :3]).reshape(len(x), -1)

    a, b = features(relative), features(known.moments)
    squares = jnp.sum(jnp.square(a), axis=-1)[:, None] + jnp.sum(jnp.square(b), axis=-1)
    return squares - 2.0 * jnp.matmul(a, b.T, precision="highest")


def _relative(history: jax.Array) -> jax.Array:
    """All links in the root's frame of each moment, and what they move more than it does."""
    place, turn, linear, angular = _split(history)
    root_place, root_turn, root_linear, root_angular = _split(history[..., :1, :])
    back = jnp.broadcast_to(quaternion.conjugate(root_turn), turn.shape)
    return jnp.concatenate(
        [
            quaternion.rotate(back, place - root_place),
            quaternion.multiply(back, turn),
            quaternion.rotate(back, linear - root_linear),
            quaternion.rotate(back, angular - root_angular),
        ],
        axis=-1,
    )


def _split(state: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """Position, rotation, linear and angular velocity of link states."""
    assert state.shape[-1] == LINK_STATE
    return state[..., :3], state[..., 3:7], state[..., 7:10], state[..., 10:]
