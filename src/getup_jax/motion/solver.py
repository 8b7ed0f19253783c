"""Inverse kinematics of whole clips: damped Gauss-Newton, each frame started at the last.

Minimised per frame, over the root and the hinges inside their limits:

    sum_l w_l |x_l - x*_l|^2 + v_l |log(R*_l R_l^T)|^2     link positions and orientations
    + g sum_p min(height_p, 0)^2                           hull points below the floor
    + a |q - q_previous|^2 + b |q - q_rest|^2              continuity, and a pull to rest
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from getup_jax.motion.body import Body
from getup_jax.motion.targets import Targets


@dataclasses.dataclass(frozen=True)
class SolverSettings:
    """Weights relative to 1 for a metre of position error."""

    position: dict[str, float] = dataclasses.field(
        default_factory=lambda: {
            **{"pelvis": 2.0, "spine": 0.3, "neck": 2.0, "head": 1.0, "thigh": 1.0},
            **{"shin": 1.5, "foot": 3.0, "shoulder": 0.3, "arm": 1.0, "forearm": 1.5, "hand": 3.0},
        }
    )
    rotation: dict[str, float] = dataclasses.field(  # per rad
        default_factory=lambda: {
            **{"pelvis": 0.1, "spine": 0.03, "neck": 0.02, "head": 0.05, "thigh": 0.02},
            **{"shin": 0.02, "foot": 0.05, "shoulder": 0.02, "arm": 0.01, "forearm": 0.02},
            **{"hand": 0.03},
        }
    )
    floor: float = 20.0  # per m of a hull point below the floor
    previous: float = 1e-3  # per rad away from the last frame
    rest: float = 1e-4  # per rad away from the neutral pose
    iterations: int = 6  # at most, a frame
    first_iterations: int = 80  # of the first frame, which has no start
    tolerance: float = 1e-3  # rad; a smaller step ends a frame


class FrameSolver:
    """Solves one frame after the other; keeps what does not change between them."""

    def __init__(self, body: Body, targets: Targets, settings: SolverSettings) -> None:
        character = body.character
        self.body, self.targets, self.settings = body, targets, settings
        self.model, self.data = character.model, mujoco.MjData(character.model)
        self.lower, self.upper = character.joint_lower, character.joint_upper
        self.rest = np.clip(character.neutral_qpos[7:], self.lower, self.upper)
        self.moves = _moves(self.model)  # [L, J]
        self.weights = _weights(targets, settings, len(character.link_names))

    def solve(self, qpos: np.ndarray, frame: int, iterations: int) -> np.ndarray:
        """The pose nearest to the targets of a frame, started at `qpos` [7 + J]."""
        previous = qpos[7:].copy()
        qpos = qpos.copy()
        for _ in range(iterations):
            hessian, gradient = self._normal_equations(qpos, frame, previous)
            step = self._bounded_step(qpos, hessian, gradient)
            _apply(qpos, step)
            if np.abs(step).max() < self.settings.tolerance:
                break
        return qpos

    def _normal_equations(
        self, qpos: np.ndarray, frame: int, previous: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """H [n, n] and the downhill vector [n] of the linearised cost; n = 6 + J."""
        data, settings = self.data, self.settings
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, data)
        position, rotation = data.xpos[1:], data.xmat[1:].reshape(-1, 3, 3)
        axis, anchor = self._axes(qpos)
        links = np.arange(len(position))
        turn = self.moves[:, :, None] * axis  # [L, 3 + J, 3]
        move = _jacobian(axis, anchor, position, self.moves, links)  # [L, 6 + J, 3]
        wanted = self.targets.position[frame] - position
        twist = _log(self.targets.rotation[frame] @ rotation.transpose(0, 2, 1))
        rows = [_rows(move), _rows(np.concatenate([np.zeros((len(links), 3, 3)), turn], axis=1))]
        right = [wanted.ravel(), twist.ravel()]
        weight = [self.weights[0], self.weights[1]]
        under = self._under_floor(position, rotation)
        if under is not None:
            points, chosen, depth = under
            moved = _jacobian(axis, anchor, points, self.moves, self.body.hull.link[chosen])
            rows.append(moved[..., 2])
            right.append(depth)
            weight.append(np.full(len(depth), settings.floor))
        jacobian, scale = np.concatenate(rows), np.concatenate(weight)
        weighted = jacobian.T * scale
        hessian, gradient = weighted @ jacobian, weighted @ np.concatenate(right)
        hinge = np.arange(6, len(hessian))
        hessian[hinge, hinge] += settings.previous + settings.rest
        hessian[np.arange(6), np.arange(6)] += 1e-9
        gradient[6:] += settings.previous * (previous - qpos[7:])
        gradient[6:] += settings.rest * (self.rest - qpos[7:])
        return hessian, gradient

    def _axes(self, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """World axes and anchors [3 + J, 3]: the root about x, y, z, then the hinges."""
        axis = np.concatenate([np.eye(3), self.data.xaxis[1:]])
        anchor = np.concatenate([np.tile(qpos[:3], (3, 1)), self.data.xanchor[1:]])
        return axis, anchor

    def _under_floor(
        self, position: np.ndarray, rotation: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Hull points below the floor: places [k, 3], indices [k] and depths [k]."""
        hull = self.body.hull
        points = position[hull.link] + (rotation[hull.link] @ hull.point[..., None])[..., 0]
        depth = hull.radius - points[:, 2]
        chosen = np.flatnonzero(depth > 0)
        return (points[chosen], chosen, depth[chosen]) if len(chosen) else None

    def _bounded_step(
        self, qpos: np.ndarray, hessian: np.ndarray, gradient: np.ndarray
    ) -> np.ndarray:
        """The step with hinges that would leave their range held at its end."""
        free = np.ones(len(gradient), bool)
        step = np.zeros(len(gradient))
        low, high = self.lower - qpos[7:], self.upper - qpos[7:]
        for _ in range(4):
            right = gradient[free] - hessian[np.ix_(free, ~free)] @ step[~free]
            step[free] = np.linalg.solve(hessian[np.ix_(free, free)], right)
            held = np.clip(step[6:], low, high)
            out = np.concatenate([np.zeros(6, bool), held != step[6:]])
            step[6:] = held
            if not out.any():
                break
            free &= ~out
        return step


def solve_clip(body: Body, targets: Targets, settings: SolverSettings) -> np.ndarray:
    """Poses [F, 7 + J] of all frames."""
    solver = FrameSolver(body, targets, settings)
    qpos = body.character.neutral_qpos.copy()
    root = body.links["pelvis"]
    qpos[:3] = targets.position[0, root]
    mujoco.mju_mat2Quat(qpos[3:7], targets.rotation[0, root].ravel())
    qpos = solver.solve(qpos, 0, settings.first_iterations)
    poses = np.empty((len(targets.position), len(qpos)))
    for frame in range(len(poses)):
        qpos = solver.solve(qpos, frame, settings.iterations)
        poses[frame] = qpos
    return poses


def _moves(model: mujoco.MjModel) -> np.ndarray:
    """[L, 3 + J] 1 where the root's turn or a hinge moves a link."""
    count = model.nbody - 1
    moves = np.zeros((count, model.njnt + 2))
    moves[:, :3] = 1.0
    for link in range(count):
        body = link + 1
        while body:
            first, number = model.body_jntadr[body], model.body_jntnum[body]
            for joint in range(first, first + number):
                if joint > 0:
                    moves[link, joint + 2] = 1.0
            body = model.body_parentid[body]
    return moves


def _weights(targets: Targets, settings: SolverSettings, count: int) -> tuple[np.ndarray, ...]:
    """Position and rotation weights [3 L], zero for links without a target."""
    position, rotation = np.zeros(count), np.zeros(count)
    for index, name in targets.names.items():
        limb = name.partition("_")[0]
        position[index], rotation[index] = settings.position[limb], settings.rotation[limb]
    return np.repeat(position, 3), np.repeat(rotation, 3)


def _jacobian(
    axis: np.ndarray, anchor: np.ndarray, points: np.ndarray, moves: np.ndarray, links: np.ndarray
) -> np.ndarray:
    """How points [k, 3] on links [k] move: [k, 6 + J, 3], root translation first."""
    arm = points[:, None] - anchor
    turn = np.empty_like(arm)
    turn[..., 0] = axis[:, 1] * arm[..., 2] - axis[:, 2] * arm[..., 1]
    turn[..., 1] = axis[:, 2] * arm[..., 0] - axis[:, 0] * arm[..., 2]
    turn[..., 2] = axis[:, 0] * arm[..., 1] - axis[:, 1] * arm[..., 0]
    turn *= moves[links][..., None]
    return np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), turn], axis=1)


def _rows(jacobian: np.ndarray) -> np.ndarray:
    """[k, n, 3] to [3 k, n]."""
    return jacobian.transpose(0, 2, 1).reshape(-1, jacobian.shape[1])


def _log(rotation: np.ndarray) -> np.ndarray:
    """Rotation vectors [L, 3] of matrices [L, 3, 3]."""
    vector = 0.5 * np.stack(
        [
            rotation[:, 2, 1] - rotation[:, 1, 2],
            rotation[:, 0, 2] - rotation[:, 2, 0],
            rotation[:, 1, 0] - rotation[:, 0, 1],
        ],
        axis=-1,
    )
    sine = np.linalg.norm(vector, axis=-1)
    cosine = 0.5 * (np.trace(rotation, axis1=1, axis2=2) - 1.0)
    angle = np.arctan2(sine, cosine)
    return vector * (angle / np.maximum(sine, 1e-9))[:, None]


def _apply(qpos: np.ndarray, step: np.ndarray) -> None:
    """Add a step: the root's turn is about world axes."""
    qpos[:3] += step[:3]
    angle = float(np.linalg.norm(step[3:6]))
    if angle > 0:
        turn, old = np.empty(4), qpos[3:7].copy()
        mujoco.mju_axisAngle2Quat(turn, step[3:6] / angle, angle)
        mujoco.mju_mulQuat(qpos[3:7], turn, old)
        qpos[3:7] /= np.linalg.norm(qpos[3:7])
    qpos[7:] += step[6:]
