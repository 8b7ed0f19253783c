"""Planted contacts: feet, knees and hands stay put while the body moves between keyframes.

Interpolated angles let a foot on the floor drift by centimetres. A damped least-squares inverse
kinematics over the whole body brings every planted point back to where the keyframes put it,
and a vertical shift then rests the lowest geom on the floor.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from getup_jax.physics.character import CharacterSpec


@dataclasses.dataclass(frozen=True)
class Contact:
    """A point of a link that can be planted on the floor."""

    link: str
    point: tuple[float, float, float]  # m, link frame
    turns: bool  # whether the link may turn about the point


_SIDES = ("l", "r")
_PARTS = ("foot", "toes", "heel", "knee", "shin", "hand", "elbow")
CONTACT_NAMES = tuple(f"{part}_{side}" for side in _SIDES for part in _PARTS)


def contacts_of(character: CharacterSpec) -> dict[str, Contact]:
    """The contacts of a character: the sole's middle, front and back edge, and limbs' geoms."""
    return {name: contact for side in _SIDES for name, contact in _of_side(character, side)}


def _of_side(character: CharacterSpec, side: str) -> list[tuple[str, Contact]]:
    model = character.model
    foot, shin, hand = (model.geom(f"{name}_{side}") for name in ("foot", "shin", "hand"))
    (x, y, z), (length, _, height) = foot.pos, foot.size
    places = {
        "foot": ("foot", (x, y, z - height), False),
        "toes": ("foot", (x + length, y, z - height), True),
        "heel": ("foot", (x - length, y, z - height), True),
        "knee": ("shin", (0.0, 0.0, shin.pos[2] + shin.size[1]), True),
        "shin": ("shin", shin.pos, False),
        "hand": ("hand", hand.pos, True),
        "elbow": ("forearm", (0.0, 0.0, 0.0), True),
    }
    return [
        (f"{name}_{side}", Contact(f"{link}_{side}", _micrometres(point), turns))
        for name, (link, point, turns) in places.items()
    ]


def _micrometres(point: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 6) for value in point)  # as a file would write them
    return x, y, z


_TURN_WEIGHT = 0.3  # m/rad, orientation errors against position errors
_ITERATIONS = 5
_TOLERANCE_M = 2e-4
_DAMPING = 1e-3


class Planter:
    """Solves single frames; holds the scratch data of one character."""

    def __init__(self, character: CharacterSpec) -> None:
        self._model = character.model
        self._data = mujoco.MjData(self._model)
        self._cost = _motion_cost(character)
        self._lower, self._upper = character.joint_lower, character.joint_upper
        self._contacts = contacts_of(character)
        self._bodies = {name: self._model.body(c.link).id for name, c in self._contacts.items()}

    def poses(self, qpos: np.ndarray, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Point (3) and link rotation (3x3, flat) of each contact in a pose."""
        self._place(qpos)
        return {name: np.concatenate([self._point(name), self._turn(name)]) for name in names}

    def solve(self, qpos: np.ndarray, targets: dict[str, np.ndarray]) -> np.ndarray:
        """The pose nearest to qpos [7 + J] whose contacts meet their targets."""
        qpos = np.array(qpos, np.float64)
        for _ in range(_ITERATIONS):
            self._place(qpos)
            jacobian, error = self._linearize(targets)
            if np.abs(error).max() < _TOLERANCE_M:
                break
            weighted = jacobian / self._cost
            gram = weighted @ jacobian.T + _DAMPING * np.eye(len(error))
            step = weighted.T @ np.linalg.solve(gram, error)
            mujoco.mj_integratePos(self._model, qpos, step, 1.0)
            qpos[7:] = np.clip(qpos[7:], self._lower, self._upper)
        return qpos

    def centre_of_mass(self, qpos: np.ndarray) -> np.ndarray:
        """Centre of mass [3] (m) of a pose."""
        self._place(qpos)
        return self._data.subtree_com[1].copy()

    def rest_on_floor(self, qpos: np.ndarray) -> np.ndarray:
        """The pose moved vertically until its lowest geom touches z = 0."""
        self._place(qpos)
        qpos = np.array(qpos, np.float64)
        data = self._data
        qpos[2] -= geom_bottoms(self._model, data.geom_xpos, data.geom_xmat).min()
        return qpos

    def _place(self, qpos: np.ndarray) -> None:
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)

    def _linearize(self, targets: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Jacobian [N, 6 + J] and error [N] (m) of every constrained coordinate."""
        rows, errors = [], []
        for name, target in targets.items():
            point, body = self._point(name), self._bodies[name]
            move, turn = np.empty((3, self._model.nv)), np.empty((3, self._model.nv))
            mujoco.mj_jac(self._model, self._data, move, turn, point, body)
            rows.append(move)
            errors.append(target[:3] - point)
            if not self._contacts[name].turns:
                rows.append(_TURN_WEIGHT * turn)
                errors.append(_TURN_WEIGHT * _turn_error(target[3:], self._data.xmat[body]))
        return np.concatenate(rows), np.concatenate(errors)

    def _point(self, name: str) -> np.ndarray:
        body = self._bodies[name]
        return self._data.xpos[body] + self._turn(name).reshape(3, 3) @ self._contacts[name].point

    def _turn(self, name: str) -> np.ndarray:
        return self._data.xmat[self._bodies[name]].copy()


def geom_bottoms(model: mujoco.MjModel, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Height of the lowest point of every colliding geom but the floor, [..., S] (m).

    position [..., G, 3] and rotation [..., G, 9] are MjData's geom_xpos and geom_xmat.
    """
    solid = np.flatnonzero((model.geom_contype != 0) & (model.geom_bodyid != 0))
    up = np.abs(rotation[..., solid, 6:])  # each local axis' share of the vertical
    size, kind = model.geom_size[solid], model.geom_type[solid]
    capsule = up[..., 2] * size[:, 1] + size[:, 0]
    box = np.sum(up * size, axis=-1)
    extent = np.where(
        kind == mujoco.mjtGeom.mjGEOM_CAPSULE,
        capsule,
        np.where(kind == mujoco.mjtGeom.mjGEOM_BOX, box, size[:, 0]),
    )
    return position[..., solid, 2] - extent


def _turn_error(target: np.ndarray, current: np.ndarray) -> np.ndarray:
    """Rotation vector (rad, world) from one rotation matrix to another, for small angles."""
    turn = target.reshape(3, 3) @ current.reshape(3, 3).T
    skew = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return 0.5 * skew


def _motion_cost(character: CharacterSpec) -> np.ndarray:
    """Cost of motion, [6 + J]: limbs move before the trunk, and the trunk before the root."""
    links = ("spine", "torso", "neck", "head")
    trunk = np.array([name.startswith(links) for name in character.joint_names])
    return np.concatenate([np.full(3, 20.0), np.full(3, 20.0), np.where(trunk, 10.0, 1.0)])
