"""Locomotion clips bent along arcs: the same steps, but turning.

After Gleicher 2001, Motion path editing: the straight path under the body becomes an arc, and
every pose is moved along with its place on the path. The feet are moved with one place as long as
they stand, so that they do not slide; inverse kinematics then brings them there. The body leans
into the turn, so that gravity and the centripetal force go through the feet.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.motion.authoring.contact_ik import Planter
from getup_jax.motion.authoring.loops import is_loop, repeated
from getup_jax.motion.clips import Clip, MotionError, continuous_signs
from getup_jax.physics.character import CharacterSpec

_GRAVITY = 9.81  # m/s^2
_SLOWEST_M_S = 0.2  # a clip that goes nowhere has no path
# A foot stands where an edge of its sole is this near the floor and this slow, and for so long:
_NEAR_M, _SLOW_M_S, _STAND_S = 0.02, 0.3, 0.1
_EDGES = ("toes", "heel")


@dataclasses.dataclass(frozen=True)
class _Path:
    """A straight line on the floor, and the arc that it becomes."""

    origin: np.ndarray  # [2] m
    ahead: np.ndarray  # [2] unit vector
    curvature: float  # rad/m, positive to the left

    def place(self, position: np.ndarray) -> np.ndarray:
        """How far [...] (m) along the line points [..., 3] are."""
        return (position[..., :2] - self.origin) @ self.ahead

    def turn(self, place: np.ndarray) -> Rotation:
        """Rotations about the vertical at places [F] on the arc."""
        place = np.atleast_1d(place)
        return Rotation.from_rotvec(np.outer(self.curvature * place, [0.0, 0.0, 1.0]))

    def bent(self, position: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Points [F, 3] moved with the places [F]."""
        angle = self.curvature * place
        left = np.array([-self.ahead[1], self.ahead[0]])
        on_arc = np.outer(np.sin(angle), self.ahead) + np.outer(1.0 - np.cos(angle), left)
        base = self.origin + on_arc / self.curvature
        offset = position.copy()
        offset[:, :2] -= self.origin + np.outer(place, self.ahead)
        moved = self.turn(place).apply(offset)
        moved[:, :2] += base
        return moved


def bent(clip: Clip, turn: float, character: CharacterSpec) -> Clip:
    """The clip along an arc on which it turns by `turn` rad/s on average, positive to the left.

    A loop stays one, turned at its end. Raises MotionError where the clip does not go anywhere.
    """
    if turn == 0.0:
        return clip
    if is_loop(clip):
        period = len(clip.qpos) - 1
        rounds = _bent(repeated(clip, 5), turn, character).qpos
        qpos = rounds[2 * period : 3 * period + 1].copy()
        qpos[-1, 7:] = qpos[0, 7:]  # which inverse kinematics only nearly keeps
        qpos[-1, 2] = qpos[0, 2]
    else:
        qpos = _bent(clip, turn, character).qpos
    return dataclasses.replace(clip, name=f"{clip.name} turning {turn:g} rad/s", qpos=qpos)


def _bent(clip: Clip, turn: float, character: CharacterSpec) -> Clip:
    way = clip.qpos[-1, :2] - clip.qpos[0, :2]
    speed = float(np.linalg.norm(way)) / clip.duration
    if speed < _SLOWEST_M_S:
        raise MotionError(
            f"{clip.name}: goes {speed:.2f} m/s, expected at least {_SLOWEST_M_S} m/s of a clip "
            "that is to be bent along an arc; leave out turns"
        )
    path = _Path(clip.qpos[0, :2], way / (speed * clip.duration), turn / speed)
    planter = Planter(character)
    feet = [f"foot_{side}" for side in "lr"]
    seen = [planter.poses(pose, [*feet, *_edges()]) for pose in clip.qpos]
    place = path.place(clip.qpos[:, :3])
    targets = {}
    for side in "lr":
        foot = np.stack([contacts[f"foot_{side}"] for contacts in seen])
        edges = np.stack([[c[f"{edge}_{side}"][:3] for edge in _EDGES] for c in seen])
        held = _held(place, _stances(edges, clip.fps))
        turned = path.turn(held).as_matrix() @ foot[:, 3:].reshape(-1, 3, 3)
        targets[f"foot_{side}"] = np.concatenate(
            [path.bent(foot[:, :3], held), turned.reshape(-1, 9)], axis=1
        )
    qpos = _leaning(clip.qpos, place, path, speed * turn / _GRAVITY)
    solved = [
        planter.solve(pose, {name: rows[frame] for name, rows in targets.items()})
        for frame, pose in enumerate(qpos)
    ]
    return dataclasses.replace(clip, qpos=np.stack(solved))


def _leaning(qpos: np.ndarray, place: np.ndarray, path: _Path, tangent: float) -> np.ndarray:
    """Poses moved with their own places, the root turned inwards about the path beneath it."""
    qpos = qpos.copy()
    lean = Rotation.from_rotvec(-np.arctan(tangent) * np.append(path.ahead, 0.0))
    beneath = np.zeros((len(qpos), 3))
    beneath[:, :2] = path.origin + np.outer(place, path.ahead)
    qpos[:, :3] = path.bent(beneath + lean.apply(qpos[:, :3] - beneath), place)
    attitude = Rotation.from_quat(qpos[:, 3:7], scalar_first=True)
    quaternion = (path.turn(place) * lean * attitude).as_quat(scalar_first=True)
    qpos[:, 3:7] = quaternion * continuous_signs(quaternion)
    return qpos


def _edges() -> list[str]:
    return [f"{edge}_{side}" for edge in _EDGES for side in "lr"]


def _stances(edges: np.ndarray, fps: float) -> list[tuple[int, int]]:
    """First and last frame of every time that a foot stands, from its edges [F, E, 3] (m)."""
    speed = np.linalg.norm(np.gradient(edges[..., :2], 1.0 / fps, axis=0), axis=-1)
    low = edges[..., 2] - edges[..., 2].min() < _NEAR_M
    stands = np.any(low & (speed < _SLOW_M_S), axis=1)
    changes = np.flatnonzero(np.diff(np.concatenate([[False], stands, [False]]).astype(int)))
    found = changes.reshape(-1, 2)  # where a time begins, and the first frame after it
    return [(int(a), int(b) - 1) for a, b in found if b - 1 - a >= _STAND_S * fps]


def _held(place: np.ndarray, stances: list[tuple[int, int]]) -> np.ndarray:
    """Places [F] on the path that a foot is moved with: one while it stands, smooth between.

    Before the first stance and after the last one it follows the body, without a jump.
    """
    held = place.copy()
    middles = [place[(first + last) // 2] for first, last in stances]
    for (first, last), middle in zip(stances, middles, strict=True):
        held[first : last + 1] = middle
    if not stances:
        return held
    held[: stances[0][0]] += middles[0] - place[stances[0][0]]
    held[stances[-1][1] + 1 :] += middles[-1] - place[stances[-1][1]]
    for index in range(len(stances) - 1):
        start, end = stances[index][1], stances[index + 1][0]
        share = np.linspace(0.0, 1.0, end - start + 1)
        share = share * share * (3.0 - 2.0 * share)
        held[start : end + 1] = middles[index] + share * (middles[index + 1] - middles[index])
    return held
