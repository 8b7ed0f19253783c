"""Small motions and files that the motion tests make for themselves."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from getup_jax.motion.clips import Clip
from getup_jax.motion.io.recording import Recording

SUPINE = Rotation.from_euler("y", -90, degrees=True)
PRONE = Rotation.from_euler("y", 90, degrees=True)

TINY_BVH = """\
HIERARCHY
ROOT Hips
{
\tOFFSET 0.0 0.0 0.0
\tCHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
\tJOINT Spine
\t{
\t\tOFFSET 0.0 10.0 0.0
\t\tCHANNELS 3 Zrotation Xrotation Yrotation
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0.0 5.0 0.0
\t\t}
\t}
}
MOTION
Frames: 2
Frame Time: 0.05
1.0 2.0 3.0 0.0 0.0 0.0 90.0 0.0 0.0
1.0 2.0 4.0 0.0 0.0 90.0 0.0 0.0 0.0
"""


def random_pose(character, rng, spread=0.6):
    """A pose [7 + J] inside the joint limits, up to `spread` of the way from neutral to them."""
    pose = character.neutral_qpos.copy()
    low, high = character.joint_lower, character.joint_upper
    share = rng.uniform(-spread, spread, len(low))
    room = np.where(share > 0, high - pose[7:], pose[7:] - low)
    pose[7:] += share * np.minimum(room, 1.2)
    pose[2] = 1.5  # in the air: no floor to keep out of
    pose[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    return pose


def getup_clip(character, lying=SUPINE, still_s=1.0, rise_s=2.0, name="rise"):
    """Lies still, rises like a board on its feet and stands still, at 30 fps."""
    still, rise = round(30 * still_s), round(30 * rise_s)
    share = np.clip((np.arange(2 * still + rise) - still) / rise, 0, 1)
    qpos = np.tile(character.neutral_qpos, (len(share), 1))
    turn = Slerp([0, 1], Rotation.concatenate([lying, Rotation.identity()]))(share)
    qpos[:, 3:7] = turn.as_quat(scalar_first=True)
    height = character.neutral_qpos[2]
    qpos[:, 2] = np.maximum(0.12, height - 0.84 * (1 - np.sin(share * np.pi / 2)))
    return Clip(name, 30.0, qpos)


def two_bones(rotations, fps=10.0):
    """A root at the origin and a child 1 m above it; rotations [F, 2, 4] wxyz."""
    rotations = np.asarray(rotations, float)
    offsets = np.array([[0.0, 0, 0], [0, 0, 1]])
    return Recording(
        name="two",
        fps=fps,
        joint_names=("a", "b"),
        parents=(-1, 0),
        offsets=offsets,
        translations=np.tile(offsets, (len(rotations), 1, 1)),
        rotations=rotations,
        ends={1: np.array([0, 0, 0.5])},
        source="two.bvh",
    )
