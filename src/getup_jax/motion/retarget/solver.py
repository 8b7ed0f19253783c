"""Inverse kinematics of whole clips: damped Gauss-Newton, each frame started at the last.

Minimised per frame, over the root and the hinges inside their limits:

    sum_l w_l |x_l - x*_l|^2 + v_l |log(R*_l R_l^T)|^2     links to targets above the floor
    + g sum_p min(height_p, 0)^2                           hull points below the floor
    + a |q - q_previous|^2 + b |q - q_rest|^2              continuity, and a pull to rest
"""

from __future__ import annotations

import dataclasses
from typing import Any

import mujoco
import numpy as np
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from getup_jax.motion.retarget.body import Body
from getup_jax.motion.retarget.jacobian import Jacobian, rotation_vectors, untwist
from getup_jax.motion.retarget.targets import Targets

_GRAM: Any = get_blas_funcs("syrk", dtype=np.float64)  # A A^T, lower half
_SOLVE: Any = get_lapack_funcs("posv", dtype=np.float64)  # by Cholesky, from the lower half
_NEAR_M = 0.15  # hull points above this height are not watched
_HOLD = 1e6  # stiffness that holds a hinge at its limit, far above every weight


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
            **{"hand": 0.005},
        }
    )
    floor: float = 20.0  # per m of a hull point below the floor
    previous: float = 5e-3  # per rad away from the last frame
    rest: float = 3e-4  # per rad away from the neutral pose
    speed: float = 14.0  # rad/s; no hinge turns faster, which also bars flips through a gimbal
    iterations: int = 6  # at most, a frame
    first_iterations: int = 20  # rounds on the first frame, which has no last one
    tolerance: float = 3e-3  # rad; a smaller step ends a frame


class FrameSolver:
    """Solves one frame after the other; keeps what does not change between them."""

    def __init__(self, body: Body, targets: Targets, settings: SolverSettings) -> None:
        character = body.character
        self.body, self.settings = body, settings
        self.model, self.data = character.model, mujoco.MjData(character.model)
        self.lower, self.upper = character.joint_lower, character.joint_upper
        self.rest = np.clip(character.neutral_qpos[7:], self.lower, self.upper)
        self.low, self.high = self.lower, self.upper  # of the frame being solved
        self.reach = settings.speed / targets.fps  # rad, how far a hinge turns in a frame
        self.wanted, self.turned = targets.position.copy(), targets.rotation
        self.wanted[..., 2] += targets.above
        self.untwist = untwist(targets.rotation)
        self.jacobian = Jacobian(self.model, body.hull.link)
        self.scale = np.sqrt(_weights(targets, settings, len(character.link_names)))

    def first(self) -> np.ndarray:
        """The pose [7 + J] of frame 0, started from the neutral pose at the target's root."""
        qpos, root = self.body.character.neutral_qpos.copy(), self.body.links["pelvis"]
        qpos[:3] = self.wanted[0, root]
        mujoco.mju_mat2Quat(qpos[3:7], self.turned[0, root].ravel())
        for _ in range(self.settings.first_iterations):
            qpos = self.solve(qpos, 0)
        return qpos

    def solve(self, qpos: np.ndarray, frame: int) -> np.ndarray:
        """The pose nearest to the targets of a frame, reached from the last pose [7 + J]."""
        previous = qpos[7:].copy()
        qpos = qpos.copy()
        self.low = np.maximum(self.lower, previous - self.reach)
        self.high = np.minimum(self.upper, previous + self.reach)
        for _ in range(self.settings.iterations):
            hessian, gradient = self._normal_equations(qpos, frame, previous)
            step = self._bounded_step(qpos, hessian, gradient)
            _apply(qpos, step)
            if np.abs(step).max() < self.settings.tolerance:
                break
        return qpos

    def _normal_equations(
        self, qpos: np.ndarray, frame: int, previous: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """H [n, n] (lower half) and the downhill vector [n] of the linearised cost; n = 6 + J."""
        data, settings = self.data, self.settings
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, data)
        self.jacobian.move_to(data)
        error = [
            (self.wanted[frame] - data.xpos[1:]).ravel(),
            rotation_vectors(self.untwist[frame], data.xquat[1:]).ravel(),
        ]
        rows = self.jacobian.links() * self.scale[:, None]
        right = np.concatenate(error) * self.scale
        hessian = _GRAM(1.0, rows.T, lower=1)
        gradient = right @ rows
        hessian.flat[:: len(hessian) + 1] += 1e-9
        hessian.flat[6 * len(hessian) + 6 :: len(hessian) + 1] += settings.previous + settings.rest
        gradient[6:] += settings.previous * (previous - qpos[7:])
        gradient[6:] += settings.rest * (self.rest - qpos[7:])
        return hessian, gradient

    def _near_floor(self) -> tuple[np.ndarray, np.ndarray]:
        """Heights [k] of the hull points that a step may push into the floor; rows [k, n]."""
        hull, data = self.body.hull, self.data
        up = data.xmat[1:, 6:][hull.link]
        height = data.xpos[1:, 2][hull.link] + (up * hull.point).sum(axis=1) - hull.radius
        near = np.flatnonzero(height < _NEAR_M)
        link = hull.link[near]
        turn = data.xmat[1:][link].reshape(-1, 3, 3)
        points = data.xpos[1:][link] + (turn @ hull.point[near][..., None])[..., 0]
        return height[near], self.jacobian.heights(points, near)

    def _bounded_step(
        self, qpos: np.ndarray, hessian: np.ndarray, gradient: np.ndarray
    ) -> np.ndarray:
        """The step that keeps hinges in their range and, softly, hull points off the floor.

        What the free step would violate is added and the step solved again, since a penalty
        on the points that are below now alone would let them bounce.
        """
        low, high = self.low - qpos[7:], self.high - qpos[7:]
        height, rows = self._near_floor()
        held, pressed = np.zeros(len(low), bool), np.zeros(len(height), bool)
        step = np.zeros(len(gradient))
        for _ in range(4):
            sinks = (height + rows @ step < 0) & ~pressed
            out = ((step[6:] < low - 1e-9) | (step[6:] > high + 1e-9)) & ~held
            if step.any() and not (sinks.any() or out.any()):
                break
            held, pressed = held | out, pressed | sinks
            at = 6 + np.flatnonzero(out)  # a stiff spring to the limit holds the hinge there
            hessian[at, at] += _HOLD
            gradient[at] += _HOLD * np.clip(step[6:], low, high)[out]
            weighted = self.settings.floor * rows[sinks]
            hessian += weighted.T @ rows[sinks]
            gradient -= height[sinks] @ weighted
            step = _SOLVE(hessian, gradient, lower=1)[1]
        step[6:] = np.clip(step[6:], low, high)
        return step


def solve_clip(body: Body, targets: Targets, settings: SolverSettings) -> np.ndarray:
    """Poses [F, 7 + J] of all frames."""
    solver = FrameSolver(body, targets, settings)
    qpos = solver.first()
    poses = np.empty((len(targets.position), len(qpos)))
    for frame in range(len(poses)):
        qpos = solver.solve(qpos, frame)
        poses[frame] = qpos
    return poses


def _weights(targets: Targets, settings: SolverSettings, count: int) -> np.ndarray:
    """Weights [6 L] of the position and rotation rows, zero for links without a target."""
    position, rotation = np.zeros(count), np.zeros(count)
    for index, name in targets.names.items():
        limb = name.partition("_")[0]
        position[index], rotation[index] = settings.position[limb], settings.rotation[limb]
    return np.repeat(np.concatenate([position, rotation]), 3)


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
