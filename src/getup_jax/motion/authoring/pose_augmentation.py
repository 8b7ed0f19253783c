"""More poses from few motions: the pose prior needs tens of thousands, a library has thousands."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from scipy.spatial import KDTree

from getup_jax.motion.authoring.contact_ik import geom_bottoms
from getup_jax.motion.clips import GetUp
from getup_jax.physics.character import CharacterSpec

_NEIGHBOURS = 12  # poses of other motions that a pose may be blended with
_ALIKE = 0.6  # mean distance of two poses that may be blended (rad; up vector times 2)
_LARGEST_SHARE = 0.5  # of the other pose in a blend


def authored_poses(
    getups: Sequence[GetUp], character: CharacterSpec, count: int, noise_rad: float, seed: int
) -> np.ndarray:
    """[count, 7 + J] poses like those of the reference motions, resting on z = 0.

    First come the frames themselves and their mirror images, as far as count goes; the rest
    are frames at random times (every motion equally often), mirrored or not, blended with an
    alike pose of another motion, and varied by Gaussian joint noise inside the limits.
    """
    rng = np.random.default_rng(seed)
    clips = [getup.clip.qpos for getup in getups if getup.clip is not None]
    if not clips:
        raise ValueError("authored_poses: no get-up has a clip; pass those of load_authored")
    clips = [side for qpos in clips for side in (qpos, character.mirror(qpos))]
    frames = np.concatenate(clips)
    extra = max(count - len(frames), 0)
    drawn, owner = _draw(clips, extra, rng)
    other = _partner(drawn, owner, clips, rng)
    share = rng.uniform(0.0, _LARGEST_SHARE, (extra, 1))
    varied = _blend(drawn, other, share)
    varied[:, 7:] += noise_rad * rng.standard_normal((extra, character.num_joints))
    varied[:, 7:] = np.clip(varied[:, 7:], character.joint_lower, character.joint_upper)
    return np.concatenate([frames[:count], _on_floor(varied, character)])


def _draw(
    clips: Sequence[np.ndarray], count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Poses [N, 7 + J] between frames at random times, and the clip [N] each is from."""
    owner = rng.integers(len(clips), size=count)
    length = np.array([len(qpos) for qpos in clips])
    first = np.concatenate([[0], np.cumsum(length)[:-1]])
    where = rng.uniform(0.0, length[owner] - 1.001)
    frame = first[owner] + where.astype(np.int64)
    frames = np.concatenate(clips)
    return _blend(frames[frame], frames[frame + 1], (where % 1.0)[:, None]), owner


def _partner(
    poses: np.ndarray, owner: np.ndarray, clips: Sequence[np.ndarray], rng: np.random.Generator
) -> np.ndarray:
    """For each pose an alike one of another motion, or the pose itself where there is none."""
    frames = np.concatenate(clips)
    motion = np.repeat(np.arange(len(clips)) // 2, [len(qpos) for qpos in clips])
    scale = 1.0 / np.sqrt(poses.shape[1] - 7)
    tree = KDTree(_likeness(frames, scale))
    nearest = tree.query(_likeness(poses, scale), k=min(_NEIGHBOURS, len(frames)))
    distance, index = (np.asarray(table) for table in nearest)
    pick = rng.integers(index.shape[1], size=len(poses))
    rows = np.arange(len(poses))
    chosen = index[rows, pick]
    alike = (distance[rows, pick] < _ALIKE) & (motion[chosen] != owner // 2)
    return np.where(alike[:, None], frames[chosen], poses)


def _likeness(qpos: np.ndarray, scale: float) -> np.ndarray:
    """Root mean square joint angles and the floor's up vector seen from the pelvis, [N, J + 3]."""
    w, x, y, z = qpos[:, 3:7].T
    up = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
    return np.concatenate([scale * qpos[:, 7:], 2.0 * up], axis=1)


def _blend(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Between two poses, after turning the second about the vertical to face like the first."""
    mixed = (1.0 - share) * first + share * second
    turned = _face_like(first[:, 3:7], second[:, 3:7])
    quaternion = (1.0 - share) * first[:, 3:7] + share * turned
    mixed[:, 3:7] = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    mixed[:, :2] = first[:, :2]
    return mixed


def _face_like(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Second quaternions [N, 4], yawed to be as near to the first as they can be."""
    w1, x1, y1, z1 = first.T
    w2, x2, y2, z2 = second.T
    # w and z of first * conjugate(second): its twist about the vertical
    cos = w1 * w2 + x1 * x2 + y1 * y2 + z1 * z2
    sin = -w1 * z2 - x1 * y2 + y1 * x2 + z1 * w2
    norm = np.maximum(np.hypot(cos, sin), 1e-9)
    cos, sin = cos / norm, sin / norm
    parts = (cos * w2 - sin * z2, cos * x2 - sin * y2, cos * y2 + sin * x2, cos * z2 + sin * w2)
    return np.stack(parts, axis=1)


def _on_floor(poses: np.ndarray, character: CharacterSpec) -> np.ndarray:
    model, data = character.model, mujoco.MjData(character.model)
    position = np.empty((len(poses), model.ngeom, 3))
    rotation = np.empty((len(poses), model.ngeom, 9))
    for row, qpos in enumerate(poses):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        position[row], rotation[row] = data.geom_xpos, data.geom_xmat
    lifted = poses.copy()
    lifted[:, 2] -= geom_bottoms(model, position, rotation).min(axis=-1)
    return lifted
