"""How links and points of a character move with its root and hinges, and how far they turn.

All of it is written for speed on one pose: the solver calls it thousands of times.
"""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation


class Jacobian:
    """Rows [.., 6 + J]: root translation (world), root turn (about world axes), hinges."""

    def __init__(self, model: mujoco.MjModel, point_link: np.ndarray) -> None:
        self.moves = _moves(model)[:, None]  # [L, 1, 3 + J]
        self.point_moves = self.moves[point_link, 0]  # [P, 3 + J]
        links, columns = len(self.moves), self.moves.shape[-1]
        self.axis = np.zeros((3, columns))
        self.axis[:, :3] = np.eye(3)
        self.cross = np.zeros((3, 3, columns))  # point -> axis x point
        self.anchor = np.zeros((columns, 3))
        self.rows = np.zeros((2, links, 3, 3 + columns))
        self.rows[0, :, :, :3] = np.eye(3)
        self.position = np.zeros((links, 3))

    def move_to(self, data: mujoco.MjData) -> None:
        """Take over the pose of `data`, whose kinematics are current."""
        self.axis[:, 3:] = data.xaxis[1:].T
        x, y, z = self.axis
        cross = self.cross
        cross[2, 0], cross[1, 0] = y, -z
        cross[0, 1], cross[2, 1] = z, -x
        cross[1, 2], cross[0, 2] = x, -y
        self.anchor[:3], self.anchor[3:] = data.xpos[1], data.xanchor[1:]
        self.offset = np.einsum("ni,ikn->kn", self.anchor, cross)
        self.position = data.xpos[1:]

    def links(self) -> np.ndarray:
        """Rows [6 L, 6 + J] of all link centres, then of all link rotations."""
        turn = (self.position @ self.cross.reshape(3, -1)).reshape(-1, *self.offset.shape)
        np.multiply(turn - self.offset, self.moves, out=self.rows[0, :, :, 3:])
        np.multiply(self.axis, self.moves, out=self.rows[1, :, :, 3:])
        return self.rows.reshape(-1, self.rows.shape[-1])

    def heights(self, points: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """Rows [k, 6 + J] of the heights of points [k, 3], which are hull points `chosen`."""
        rows = np.zeros((len(points), self.rows.shape[-1]))
        rows[:, 2] = 1.0
        rows[:, 3:] = (points @ self.cross[:, 2] - self.offset[2]) * self.point_moves[chosen]
        return rows


def untwist(rotation: np.ndarray) -> np.ndarray:
    """[F, L, 4, 4] that take a link's quaternion to target times its inverse."""
    flat = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    w, x, y, z = flat.T
    rows = [[w, x, y, z], [x, -w, z, -y], [y, -z, -w, x], [z, y, -x, -w]]
    return np.moveaxis(np.array(rows), -1, 0).reshape(*rotation.shape[:2], 4, 4)


def rotation_vectors(factors: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """World rotation vectors [L, 3] from links [L, 4] to their targets."""
    error = (factors @ quaternion[..., None])[..., 0]
    error *= np.where(error[:, :1] < 0, -1.0, 1.0)
    sine = np.linalg.norm(error[:, 1:], axis=1)
    angle = 2.0 * np.arctan2(sine, error[:, 0])
    return error[:, 1:] * (angle / np.maximum(sine, 1e-9))[:, None]


def _moves(model: mujoco.MjModel) -> np.ndarray:
    """[L, 3 + J] 1 where the root's turn or a hinge moves a link."""
    count = model.nbody - 1
    moves = np.zeros((count, model.njnt + 2))
    moves[:, :3] = 1.0
    for link in range(count):
        body = link + 1
        while body:
            first, number = model.body_jntadr[body], model.body_jntnum[body]
            if body > 1:  # hinges; the root's free joint is the first columns
                moves[link, first + 2 : first + number + 2] = 1.0
            body = model.body_parentid[body]
    return moves
