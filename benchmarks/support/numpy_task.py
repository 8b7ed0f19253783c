"""The get-up task as people write one: a Gymnasium environment of one character, MuJoCo and NumPy.

Same character, rates, start states, observation, action, reward and ends as `envs/getup/task.py`,
without what only helps to train; `tests/benchmarks/test_numpy_task.py` holds the two side by side.
It knows nothing of JAX, so that a process of it is small and starts at once: the parts that a
training does not change come from a file of `support/task_file.py`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np

LIMIT = 10.0  # of actions, as in getup_jax.gym
_KNOTS = np.arange(-1, 10)
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
_INVERSE = np.array([1.0, -1.0, -1.0, -1.0])


class NumpyGetUp(gymnasium.Env):
    """One character; `info` has `is_success` where an episode ends."""

    def __init__(self, folder: Path) -> None:
        self.model = mujoco.MjModel.from_binary_path(str(folder / "model.mjb"))
        self.data = mujoco.MjData(self.model)
        with np.load(folder / "task.npz") as file:
            self._c: dict[str, np.ndarray] = {name: file[name] for name in file.files}
        self._dt = float(self._c["control_dt"])
        self._parents = self.model.body_parentid[2:] - 1
        size = self.model.nu + self._c["latent_mean"].size
        self.action_space = gymnasium.spaces.Box(-LIMIT, LIMIT, (size,), np.float32)
        self.start(0)
        shape = self._observe(self._posture()).shape
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, shape, np.float32)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[np.ndarray, dict]:
        """One of the start states."""
        super().reset(seed=seed)
        self.start(int(self.np_random.integers(len(self._c["qpos"]))))
        return self._observe(self._posture()), {}

    def start(self, index: int) -> None:
        """The start state of that number."""
        c, data = self._c, self.data
        mujoco.mj_resetData(self.model, data)
        data.qpos[:], data.qvel[:] = c["qpos"][index], c["qvel"][index]
        self._derive()
        self._time, self._duration = float(c["time"][index]), float(c["duration"][index])
        self._points, self._action = c["points"][index], c["action"][index].copy()
        self._unasked = self._offset()  # holds the start pose, and is not counted
        self._ahead = self._curve()
        self._low = self._head = 0
        self._ratios: list[float] = []

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One control step."""
        c = self._c
        self._action = c["filter"] * action + (1.0 - c["filter"]) * self._action
        self._unasked = (1.0 - c["filter"]) * self._unasked
        self.data.ctrl[:] = self._target(self._ahead[0])
        mujoco.mj_step(self.model, self.data, nstep=int(c["substeps"]))
        self._derive()
        self._time += self._dt
        self._ahead, posture = self._curve(), self._posture()
        task, natural = self._reward(posture, self._ahead[0])
        terminated = self._ended(task)
        left = self._duration + float(c["stand_time_s"]) - self._time
        truncated = not terminated and left < 0.5 * self._dt
        if self._time > self._duration:
            self._ratios.append(posture["features"][0] / self._points[-1, 0])
        info = {"is_success": truncated and self._stands()} if terminated or truncated else {}
        return self._observe(posture), float(task * natural), terminated, truncated, info

    def _derive(self) -> None:
        """Places and velocities of the links, of the state that there is now."""
        for derive in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel):
            derive(self.model, self.data)

    def _curve(self) -> np.ndarray:
        """Values [n, 3] of the curves at the look-ahead times: a clamped cubic B-spline."""
        u = np.clip((self._time + self._c["lookahead_s"]) / self._duration, 0.0, 1.0) * 8.0
        x = np.abs(u[:, None] - _KNOTS)
        near, far = 2.0 / 3.0 - x**2 + x**3 / 2.0, (2.0 - x) ** 3 / 6.0
        weight = np.where(x < 1.0, near, np.where(x < 2.0, far, 0.0))
        p = self._points
        padded = np.concatenate([[2.0 * p[0] - p[1]], p, [2.0 * p[-1] - p[-2]]])
        return weight @ padded

    def _target(self, condition: np.ndarray) -> np.ndarray:
        """Servo targets [J]: the decoded pose of the latent, and offsets."""
        c, size = self._c, self._c["latent_mean"].size
        latent = self._action[:size] * c["latent_std"] + c["latent_mean"]
        rows = [np.concatenate([latent, condition])]
        if "mirror_index" in c:
            image = np.array([condition[0], np.pi - condition[1], condition[2]])
            rows.append(np.concatenate([latent * c["latent_sign"], image]))
        x = np.stack(rows).astype(np.float32)
        x[:, size:] = (x[:, size:] - c["condition_mean"]) / c["condition_std"]
        for layer in range(int(c["layers"])):
            x = np.tanh(x @ c[f"kernel_{layer}"] + c[f"bias_{layer}"])
        pose = (x @ c["kernel_out"] + c["bias_out"]) * c["angle_std"] + c["angle_mean"]
        if len(rows) == 2:
            pose = 0.5 * (pose[:1] + pose[1:, c["mirror_index"]] * c["mirror_sign"])
        target = pose[0] + self._offset()
        return np.clip(target, c["target_lower"], c["target_upper"])

    def _posture(self) -> dict[str, np.ndarray]:
        """See `Posture` in envs/getup/observation.py."""
        d = self.data
        place, world = d.xpos[1:], d.xquat[1:]
        parent = world[self._parents] * _INVERSE
        joint = _multiply(parent, world[1:])
        joint[joint[:, 0] < 0.0] *= -1.0
        omega = d.cvel[2:, :3]
        linear = d.cvel[2:, 3:] + _cross(omega, place[1:] - d.subtree_com[1])
        w, z = world[0, 0], world[0, 3]
        norm = max(np.hypot(w, z), 1e-6)
        cos, sin = (w * w - z * z) / norm**2, 2.0 * w * z / norm**2
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])  # to world, by rows
        neck, left, right = (place[i] for i in self._c["feature_links"])
        side = _unit(right - left)
        front = _unit(_cross(neck - 0.5 * (left + right), side))
        up = [np.arctan2(np.hypot(v[0], v[1]), v[2]) for v in (side, front)]
        return {
            "joint": joint,
            "place": (place[1:] - place[0]) @ turn,
            "omega": omega @ turn,
            "linear": linear @ turn,
            "features": np.array([neck[2], *up]),
            "ground": np.full(25, place[0, 2]),
        }

    def _observe(self, posture: dict[str, np.ndarray]) -> np.ndarray:
        blocks = [*posture.values(), self._ahead, self._action]
        return np.concatenate([block.ravel() for block in blocks]).astype(np.float32)

    def _offset(self) -> np.ndarray:
        """Hinge offsets [J] (rad) of the filtered action."""
        return self._c["offset_scale"] * self._action[self._c["latent_mean"].size :]

    def _reward(self, posture: dict[str, np.ndarray], target: np.ndarray) -> tuple[float, float]:
        """The task reward and that of natural offsets [P equations 3 to 9]."""
        c, value = self._c, posture["features"]
        alpha = np.exp(-20.0 * (1.0 - min(target[0] / self._points[-1, 0], 1.0)))
        error = _multiply(c["neutral"] * _INVERSE, posture["joint"])
        angle = 2.0 * np.arctan2(np.linalg.norm(error[:, 1:], axis=1), np.abs(error[:, 0]))
        height = np.exp(-1.7 * abs(value[0] - target[0]))
        orientation = np.exp(-1.5 * np.abs(value[1:] - target[1:]).sum())
        velocity = 1.0 - alpha + alpha * np.exp(-0.05 * np.linalg.norm(posture["omega"]))
        pose = 1.0 - alpha + alpha * np.exp(-0.1 * angle.sum())
        offset = np.abs(self._offset() - self._unasked).sum()
        natural = 1.0 - min((offset / c["offset_limit_rad"]) ** 2, 1.0)
        return height * orientation * velocity * pose, natural

    def _ended(self, task: float) -> bool:
        c = self._c
        matrix = self.data.xmat[1 + int(c["head_link"])].reshape(3, 3)
        centre = self.data.xpos[1 + int(c["head_link"])] + matrix @ c["head_centre"]
        self._low = self._low + 1 if task < c["terminate_reward"] else 0
        on_floor = centre[2] - c["head_radius"] < c["head_clearance_m"]
        self._head = self._head + 1 if on_floor else 0
        most = c["terminate_after_s"] / self._dt + 1e-3
        return bool(self._low > most or self._head > most or not np.isfinite(self.data.qpos).all())

    def _stands(self) -> bool:
        last = self._ratios[-round(1.0 / self._dt) :]
        return bool(np.mean(self._ratios) >= 0.9 and min(last) >= 0.85)


def _multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products [N, 4] of quaternions (w x y z)."""
    out = np.empty_like(b)
    out[:, 0] = a[:, 0] * b[:, 0] - (a[:, 1:] * b[:, 1:]).sum(axis=1)
    out[:, 1:] = a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + _cross(a[:, 1:], b[:, 1:])
    return out


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """As np.cross, which takes several times as long for so few."""
    return a[..., _NEXT] * b[..., _LAST] - a[..., _LAST] * b[..., _NEXT]


def _unit(v: np.ndarray) -> np.ndarray:
    return v / max(np.linalg.norm(v), 1e-8)
