"""States of the flat plane set down on irregular ground, so that rises start on slopes, too."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.surface import TOUCH_M, lift
from getup_jax.physics.terrain import HeightField


def project_to_ground(
    character: CharacterSpec,
    field: HeightField,
    qpos: np.ndarray,
    qvel: np.ndarray,
    xy: np.ndarray,
    yaw: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """qpos [N, 7 + J] and qvel [N, 6 + J] of flat states, moved to xy [N, 2] and turned by yaw [N].

    What lies is turned with the slope and what stands is not: by the share (1 - h / H) of its
    angle, h being the height of the pelvis and H that of the neutral pose. The state is then
    moved up or down until it touches the ground.
    """
    standing = character.neutral_qpos[2]
    share = 1.0 - np.clip(qpos[:, 2] / standing, 0.0, 1.0)
    heading = Rotation.from_rotvec(yaw[:, None] * np.array([0.0, 0.0, 1.0]))
    turn = to_normal(field.normal(xy), share) * heading
    qpos, qvel = qpos.copy(), qvel.copy()
    qpos[:, :2], qpos[:, 2] = xy, qpos[:, 2] + field.height(xy)
    qpos[:, 3:7] = (turn * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).as_quat(
        scalar_first=True
    )
    qvel[:, :3] = turn.apply(qvel[:, :3])  # that of the root's angles is in its own frame
    return lift(character, field, qpos, -TOUCH_M), qvel


def to_normal(normal: np.ndarray, share: np.ndarray | float = 1.0) -> Rotation:
    """Turns by a share [N] of the angle between the vertical and unit normals [N, 3]."""
    axis = np.cross([0.0, 0.0, 1.0], normal)
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(length, normal[:, 2:]) * np.reshape(share, (-1, 1))
    return Rotation.from_rotvec(axis / np.maximum(length, 1e-9) * angle)
