"""The three features that style curves control [P 4.2]: height and two torso angles."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp

from getup_jax.physics.character import CharacterSpec

NAMES = ("height", "side_angle", "front_angle")


@dataclasses.dataclass(frozen=True)
class FeatureLinks:
    """Indices of the links that the features are measured at."""

    root: int
    neck: int
    left_hip: int
    right_hip: int

    @classmethod
    def of(cls, character: CharacterSpec) -> FeatureLinks:
        """Look the links up by name."""
        names = ("pelvis", "neck", "thigh_l", "thigh_r")
        return cls(*(character.link(name) for name in names))


def features(
    links: FeatureLinks, link_position: jax.Array, ground_height: jax.Array | float
) -> jax.Array:
    """w = (h, theta_x, theta_z) of poses.

    link_position [..., L, 3] (m, world, Z up), ground_height [...] (m). Returns [..., 3]:
    height of the neck base above the ground (m), angle between the side vector (pelvis to its
    right) and up, angle between the front vector and up (rad, 0 to pi). Supine: the front
    angle is 0; prone: pi; standing: both are pi / 2.
    """
    height = link_position[..., links.neck, 2] - ground_height
    angles = _angle_to_up(torso_axes(links, link_position))
    return jnp.concatenate([height[..., None], angles], axis=-1)


def torso_axes(links: FeatureLinks, link_position: jax.Array) -> jax.Array:
    """Unit side and front vector [..., 2, 3] of the torso in poses [..., L, 3], world frame."""
    neck = link_position[..., links.neck, :]
    right, left = (link_position[..., i, :] for i in (links.right_hip, links.left_hip))
    side = _unit(right - left)
    # [P 3.1]: the cross product of the hips-to-neck and the side vector points forward
    front = _unit(jnp.cross(neck - 0.5 * (left + right), side))
    return jnp.stack([side, front], axis=-2)


def _unit(v: jax.Array) -> jax.Array:
    return v / jnp.maximum(jnp.linalg.norm(v, axis=-1, keepdims=True), 1e-8)


def _angle_to_up(unit: jax.Array) -> jax.Array:
    """Angle to +z; atan2 keeps its precision near 0 and pi, where arccos loses it."""
    return jnp.arctan2(jnp.linalg.norm(unit[..., :2], axis=-1), unit[..., 2])
