"""Poses and velocities of all links from positions and velocities of joints, in JAX alone.

Engines have their own; this one is for what leaves them, such as exported policies. It is a short
program, level by level down the tree, over any leading axes.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import ConfigError
from getup_jax.core.quaternion import rotate
from getup_jax.core.types import Kinematics
from getup_jax.physics.character import CharacterSpec

# [4, 16]: a quaternion times this is the matrix that multiplies by it from the left
_LEFT = np.array(
    [
        [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
        [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0],
        [0, 0, -1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, -1, 0, 0],
        [0, 0, 0, -1, 0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0],
    ],
    np.float32,
)


@dataclasses.dataclass(frozen=True, eq=False)
class LinkTree:
    """Where every link is on its parent, and the hinges between them."""

    parent: np.ndarray  # [L] of a link; -1: the root
    offset: np.ndarray  # [L, 3] in the parent (m)
    turn: np.ndarray  # [L, 4] of the link at hinge angles 0
    hinge: np.ndarray  # [L, H] hinges of a link, the outermost first; J: none
    axis: np.ndarray  # [J + 1, 3] of hinges, the last one a filler

    @classmethod
    def of(cls, character: CharacterSpec) -> LinkTree:
        """Raises ConfigError where a hinge is not at the origin of its link."""
        model, links = character.model, len(character.link_names)
        hinges = [np.flatnonzero(character.joint_link == link) for link in range(links)]
        table = np.full((links, max(map(len, hinges))), character.num_joints)
        for link, own in enumerate(hinges):
            table[link, : len(own)] = own
        joints = [model.joint(name).id for name in character.joint_names]
        if np.abs(model.jnt_pos[joints]).max() > 1e-9:
            raise ConfigError("physics.character: expected every hinge at the origin of its link")
        return cls(
            parent=model.body_parentid[1:] - 1,
            offset=model.body_pos[1:].astype(np.float32),
            turn=model.body_quat[1:].astype(np.float32),
            hinge=table,
            axis=np.concatenate([model.jnt_axis[joints], np.zeros((1, 3))]).astype(np.float32),
        )

    def way(self) -> np.ndarray:
        """[L, L]: 1 where the second link is the first one or on its way to the root."""
        found = np.eye(len(self.parent), dtype=np.float32)
        for link in range(1, len(found)):
            found[link] += found[self.parent[link]]
        return found

    def levels(self) -> list[np.ndarray]:
        """The links below the root, all of one depth at a time."""
        depth = np.zeros(len(self.parent), int)
        for link in range(1, len(depth)):
            depth[link] = depth[self.parent[link]] + 1
        return [np.flatnonzero(depth == level) for level in range(1, depth.max() + 1)]


def kinematics(tree: LinkTree, qpos: jax.Array, qvel: jax.Array) -> Kinematics:
    """What tasks read of positions [..., 7 + J] and velocities [..., 6 + J]; torque is 0."""
    turn, rate = _relative(tree, qpos[..., 7:], qvel[..., 6:])
    root = qpos[..., None, 3:7]
    root = root / jnp.sqrt(jnp.sum(root * root, axis=-1, keepdims=True))
    quaternion = _chained(tree, root, turn)
    # all that is added up along the way from the root to a link, the link included
    way = jnp.asarray(tree.way())[:, 1:]
    before = jnp.take(quaternion, tree.parent[1:], axis=-2, mode="clip")
    arm = rotate(before, jnp.broadcast_to(tree.offset[1:], before[..., 1:].shape))
    angular = rotate(root, qvel[..., None, 3:6]) + way @ rotate(before, rate[..., 1:, :])
    turning = jnp.take(angular, tree.parent[1:], axis=-2, mode="clip")
    return Kinematics(
        qpos=qpos,
        qvel=qvel,
        link_position=qpos[..., None, :3] + way @ arm,
        link_quaternion=quaternion,
        link_angular_velocity=angular,
        link_linear_velocity=qvel[..., None, :3] + way @ jnp.cross(turning, arm),
        torque=jnp.zeros_like(qpos[..., 7:]),
        finite=jnp.abs(qpos[..., 0]) < jnp.inf,
    )


def _chained(tree: LinkTree, root: jax.Array, turn: jax.Array) -> jax.Array:
    """Rotations [..., L, 4] in the world of rotations [..., L, 4] in the parents."""
    found, order = root, np.zeros(1, int)
    for links in tree.levels():
        at = [int(np.flatnonzero(order == parent)[0]) for parent in tree.parent[links]]
        parents = jnp.take(found, np.array(at), axis=-2, mode="clip")
        own = jnp.take(turn, links, axis=-2, mode="clip")
        found = jnp.concatenate([found, _product(parents, own)], axis=-2)
        order = np.concatenate([order, links])
    return jnp.take(found, np.argsort(order), axis=-2, mode="clip")


def _relative(tree: LinkTree, angle: jax.Array, rate: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Rotation [..., L, 4] of links in their parents, and its rate [..., L, 3] there (rad/s)."""
    zero = jnp.zeros_like(angle[..., :1])
    half = 0.5 * jnp.concatenate([angle, zero], axis=-1)[..., None]
    turns = jnp.concatenate([jnp.cos(half), jnp.sin(half) * tree.axis], axis=-1)
    rates = jnp.concatenate([rate, zero], axis=-1)[..., None] * tree.axis
    turn = jnp.broadcast_to(tree.turn, (*angle.shape[:-1], *tree.turn.shape))
    spin = jnp.zeros_like(turn[..., 1:])
    for hinges in tree.hinge.T:
        spin = spin + rotate(turn, jnp.take(rates, hinges, axis=-2, mode="clip"))
        turn = _product(turn, jnp.take(turns, hinges, axis=-2, mode="clip"))
    return turn, spin


def _product(a: jax.Array, b: jax.Array) -> jax.Array:
    """Rotation b [..., 4], then a; by matrices, which are fewer operations than numbers are."""
    matrix = (a @ _LEFT).reshape(*a.shape[:-1], 4, 4)
    return (matrix @ b[..., None])[..., 0]
