"""The 352 observation numbers of [P 3.3], built from one table."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from getup_jax.core import quaternion
from getup_jax.core.types import Kinematics
from getup_jax.motion.getup.curves import FeatureLinks, features
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.terrain import Ground

GRID_POINTS = 5  # a side of the height map
GRID_STEP_M = 0.25


@struct.dataclass
class Posture:
    """What one physics state looks like to the task."""

    joint_rotation: jax.Array  # [B, L - 1, 4] link relative to its parent, w >= 0
    link_position: jax.Array  # [B, L - 1, 3] from the root, heading frame (m)
    link_angular_velocity: jax.Array  # [B, L - 1, 3] heading frame (rad/s)
    link_linear_velocity: jax.Array  # [B, L - 1, 3] heading frame (m/s)
    features: jax.Array  # [B, 3] height (m), side and front angle (rad)
    height_map: jax.Array  # [B, 25] root height above the ground (m), rows front to back


@dataclasses.dataclass(frozen=True)
class Observer:
    """Index tables of one character, and the layout of its observation."""

    parents: tuple[int, ...]  # of the links 1 ... L - 1
    links: FeatureLinks
    table: tuple[tuple[str, int], ...]  # (name, size) in order: the only definition of the layout
    relief_gain: float = 1.0  # times the differences within the height map

    @classmethod
    def of(
        cls,
        character: CharacterSpec,
        num_lookahead: int,
        action_size: int,
        relief_gain: float = 1.0,
    ) -> Observer:
        """The layout for a character, a number of look-ahead targets and an action."""
        joints = len(character.link_names) - 1
        table = (
            ("joint_rotation", 4 * joints),
            ("link_position", 3 * joints),
            ("link_angular_velocity", 3 * joints),
            ("link_linear_velocity", 3 * joints),
            ("features", 3),
            ("height_map", GRID_POINTS**2),
            ("targets", 3 * num_lookahead),
            ("action", action_size),
        )
        parents = tuple(int(i) - 1 for i in character.model.body_parentid[2:])
        links = FeatureLinks.of(character)
        return cls(parents=parents, links=links, table=table, relief_gain=relief_gain)

    @property
    def size(self) -> int:
        """O, the length of an observation."""
        return sum(size for _, size in self.table)

    def slices(self) -> dict[str, slice]:
        """Where each block lies in an observation."""
        ends = np.cumsum([size for _, size in self.table])
        return {name: slice(end - size, end) for (name, size), end in zip(self.table, ends)}  # noqa: B905

    def condition(self, observation: jax.Array) -> jax.Array:
        """The curve values now [..., 3] in raw observations [..., O]: the first of the targets."""
        return observation[..., self.slices()["targets"]][..., :3]

    def evened(self, observation: jax.Array) -> jax.Array:
        """Raw observations [..., O] as if the ground below them were even, at its mean height."""
        block = self.slices()["height_map"]
        mean = jnp.mean(observation[..., block], axis=-1, keepdims=True)
        return observation.at[..., block].set(mean)

    def posture(self, kinematics: Kinematics, terrain: Ground) -> Posture:
        """Everything that the observation and the rewards take from a physics state."""
        root_position = kinematics.link_position[:, :1]
        to_heading = quaternion.conjugate(quaternion.heading(kinematics.link_quaternion[:, :1]))

        def local(v: jax.Array) -> jax.Array:
            return quaternion.rotate(to_heading, v)

        ground = self._ground(root_position[:, 0], quaternion.conjugate(to_heading), terrain)
        return Posture(
            joint_rotation=self.joint_rotation(kinematics.link_quaternion),
            link_position=local(kinematics.link_position[:, 1:] - root_position),
            link_angular_velocity=local(kinematics.link_angular_velocity[:, 1:]),
            link_linear_velocity=local(kinematics.link_linear_velocity[:, 1:]),
            features=features(self.links, kinematics.link_position, jnp.mean(ground, axis=-1)),
            height_map=root_position[:, 0, 2:] - ground,
        )

    def joint_rotation(self, link_quaternion: jax.Array) -> jax.Array:
        """Rotation of every link relative to its parent [..., L - 1, 4] from [..., L, 4]."""
        parent = link_quaternion[..., self.parents, :]
        relative = quaternion.multiply(quaternion.conjugate(parent), link_quaternion[..., 1:, :])
        return quaternion.canonical(relative)

    def observe(self, posture: Posture, targets: jax.Array, action: jax.Array) -> jax.Array:
        """The observation [B, O]; targets [B, n, 3] of the curves, action the filtered one."""
        blocks = {
            name: getattr(posture, name) for name, _ in self.table if hasattr(posture, name)
        } | {"targets": targets, "action": action}
        if self.relief_gain != 1.0:
            mean = jnp.mean(posture.height_map, axis=-1, keepdims=True)
            blocks["height_map"] = mean + self.relief_gain * (posture.height_map - mean)
        batch = action.shape[:-1]
        flat = [blocks[name].reshape(*batch, size) for name, size in self.table]
        return jnp.concatenate(flat, axis=-1)

    def _ground(self, root: jax.Array, to_world: jax.Array, terrain: Ground) -> jax.Array:
        """Ground height [B, 25] on the heading-aligned grid around the root [B, 3]."""
        half = GRID_STEP_M * (GRID_POINTS - 1) / 2
        steps = jnp.linspace(half, -half, GRID_POINTS)
        x, y = jnp.meshgrid(steps, steps, indexing="ij")
        grid = jnp.stack([x, y, jnp.zeros_like(x)], axis=-1).reshape(1, -1, 3)
        world = root[:, None] + quaternion.rotate(to_world, grid)
        return terrain.height(world[..., :2])
