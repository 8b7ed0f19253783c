"""How a motion feels beside whether it succeeds: one number a step and simulation each."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from getup_jax.core.quaternion import rotate
from getup_jax.core.types import Kinematics
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.terrain import Ground

SATURATED = 0.99  # of the torque limit
CONTACT_M = 0.005  # a point of a foot nearer to the ground touches it


def power(torque: jax.Array, rate: jax.Array) -> jax.Array:
    """Sum over the hinges of |torque x rate| [B] (W); torque [B, J] (Nm), rate [B, J] (rad/s)."""
    return jnp.abs(torque * rate).sum(axis=-1)


def jerk(rates: jax.Array, control_dt: float) -> jax.Array:
    """Mean |third derivative| of the hinge angles [B] (rad/s^3), by second differences.

    rates [3, B, J] (rad/s) of three control steps in a row.
    """
    return jnp.abs(rates[2] - 2.0 * rates[1] + rates[0]).mean(axis=-1) / control_dt**2


def saturation(torque: jax.Array, limit: jax.Array) -> jax.Array:
    """Share [B] of the hinges whose torque [B, J] is at its limit [J] (Nm)."""
    return (jnp.abs(torque) >= SATURATED * limit).mean(axis=-1)


@dataclasses.dataclass(frozen=True, eq=False)
class FootPoints:
    """Q points of the feet that can touch the ground: box corners, ends of capsules, spheres."""

    link: np.ndarray  # [Q]
    offset: np.ndarray  # [Q, 3] in the link's frame (m)
    radius: np.ndarray  # [Q] m

    @classmethod
    def of(cls, character: CharacterSpec) -> FootPoints:
        """All points of the links whose name starts with `foot`."""
        model, points = character.model, []
        for geom in range(model.ngeom):
            link = int(model.geom_bodyid[geom]) - 1
            if link >= 0 and character.link_names[link].startswith("foot"):
                points += [(link, offset, r) for offset, r in _geom_points(model, geom)]
        link, offset, radius = (np.array(part) for part in zip(*points, strict=True))
        return cls(link, offset.astype(np.float32), radius.astype(np.float32))

    def slip(self, kinematics: Kinematics, terrain: Ground) -> jax.Array:
        """Mean horizontal speed [B] (m/s) of the points that touch the ground; NaN: none does.

        A foot that rolls over an edge does not slip: the speed is that of the edge.
        """
        rotation = kinematics.link_quaternion[:, self.link]
        arm = rotate(rotation, jnp.asarray(self.offset))
        point = kinematics.link_position[:, self.link] + arm
        turning = jnp.cross(kinematics.link_angular_velocity[:, self.link], arm)
        velocity = kinematics.link_linear_velocity[:, self.link] + turning
        gap = terrain.clearance(point, jnp.asarray(self.radius))
        touches = gap < CONTACT_M
        speed = jnp.where(touches, jnp.linalg.norm(velocity[..., :2], axis=-1), 0.0)
        count = touches.sum(axis=-1)
        return jnp.where(count > 0, speed.sum(axis=-1) / jnp.maximum(count, 1), jnp.nan)


def self_penetration(model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """Deepest overlap [n] (m) of two links in poses [n, 7 + J]; 0: nothing overlaps.

    Links that the character excludes from touching each other do not count.
    """
    data, deepest = mujoco.MjData(model), np.zeros(len(qpos), np.float32)
    for i, pose in enumerate(qpos):
        if not np.isfinite(pose).all():
            continue  # a simulation that failed has no shape
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        contact = data.contact
        own = (model.geom_bodyid[contact.geom] > 0).all(axis=-1)
        deepest[i] = max(0.0, -contact.dist[own].min(initial=0.0))
    return deepest


def _geom_points(model: mujoco.MjModel, geom: int) -> list[tuple[np.ndarray, float]]:
    """Offsets in the link's frame and radii of a geom's extreme points."""
    kind, size, centre = model.geom_type[geom], model.geom_size[geom], model.geom_pos[geom]
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, model.geom_quat[geom])
    turn = matrix.reshape(3, 3)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
        return [(centre + turn @ (sign * size), 0.0) for sign in signs]
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        axis = turn[:, 2] * size[1]
        return [(centre + axis, float(size[0])), (centre - axis, float(size[0]))]
    return [(centre, float(size[0]))]
