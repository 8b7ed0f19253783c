"""The poses that a prior is trained on: joint angles, their features, and what is held out."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from getup_jax.core.mirror import SignedPermutation
from getup_jax.motion.getup.curves import FeatureLinks, features
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.mirror_image import is_symmetric, joint_mirror

# Rows in a block that is held out as one: 1 s of the usual 30 Hz. Single random frames would be
# held out between near-copies of themselves, which says nothing about unseen poses.
BLOCK = 30

# Short sets are cut finer, so that a share of them can be held out at all.
MIN_BLOCKS = 10


@dataclasses.dataclass(frozen=True, eq=False)
class PoseSet:
    """Poses of one character. Raises ValueError where the arrays do not fit or are not finite."""

    angles: np.ndarray  # [N, J] rad
    condition: np.ndarray  # [N, 3] features over flat ground (m, rad)
    group: np.ndarray  # [N] rows of one group are held out together
    joint_lower: np.ndarray  # [J] rad
    joint_upper: np.ndarray  # [J] rad
    mirror: SignedPermutation | None = None  # [J] of the angles; None: the body has no image

    def __post_init__(self) -> None:
        count, joints = self.angles.shape
        shapes = {
            "condition": (count, 3),
            "group": (count,),
            "joint_lower": (joints,),
            "joint_upper": (joints,),
        }
        for name, expected in shapes.items():
            got = getattr(self, name).shape
            if got != expected:
                raise ValueError(f"poses.{name}: expected shape {expected}, got {got}")
        rows = np.concatenate([self.angles, self.condition], axis=1)
        bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
        if len(bad):
            raise ValueError(f"poses: {len(bad)} rows are not finite, the first is row {bad[0]}")
        if len(np.unique(self.group)) < 2:
            raise ValueError(f"poses: expected at least 2 groups to hold one out, got {count} rows")


def make_pose_set(
    poses: np.ndarray,
    character: CharacterSpec,
    mirrored: bool = False,
    group: np.ndarray | None = None,
) -> PoseSet:
    """The poses [N, 7 + J] with their features.

    `mirrored` says that the second half are the mirror images of the first, as a motion library
    gives them; an image is held out with its original. `group` [N, or half of it if mirrored] says
    what else is held out together; without it, rows are time series that are cut into blocks.
    """
    poses = np.asarray(poses, np.float64)
    images = 2 if mirrored else 1
    if len(poses) % images:
        raise ValueError(f"poses: expected an even number with mirror images, got {len(poses)}")
    group = blocks(len(poses) // images) if group is None else np.asarray(group)
    return PoseSet(
        angles=poses[:, 7:].astype(np.float32),
        condition=pose_conditions(poses, character),
        group=np.tile(group, images),
        joint_lower=character.joint_lower.astype(np.float32),
        joint_upper=character.joint_upper.astype(np.float32),
        mirror=joint_mirror(character) if is_symmetric(character) else None,
    )


def blocks(count: int) -> np.ndarray:
    """Group [N] of rows of a time series: contiguous blocks of BLOCK, or of a tenth if shorter."""
    size = max(1, min(BLOCK, count // MIN_BLOCKS))
    return np.arange(count) // size


def split(group: np.ndarray, holdout: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Sorted row indices to train on and to hold out; no group is in both.

    Whole groups are drawn at random, about `holdout` of them, at least one and never all.
    """
    names = np.unique(group)
    count = int(np.clip(round(holdout * len(names)), 1, len(names) - 1))
    chosen = np.random.default_rng(seed).choice(names, count, replace=False)
    held_out = np.isin(group, chosen)
    return np.flatnonzero(~held_out), np.flatnonzero(held_out)


def pose_conditions(poses: np.ndarray, character: CharacterSpec) -> np.ndarray:
    """Features [N, 3] of poses [N, 7 + J] that stand, sit or lie on the ground z = 0."""
    positions = link_positions(poses, character)
    return features(FeatureLinks.of(character), positions, 0.0).astype(np.float32)


def link_positions(poses: np.ndarray, character: CharacterSpec) -> np.ndarray:
    """Joint centres [N, L, 3] (m, world) of poses [N, 7 + J], float32."""
    data = mujoco.MjData(character.model)
    positions = np.empty((len(poses), len(character.link_names), 3), np.float32)
    for row, qpos in enumerate(np.asarray(poses, np.float64)):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(character.model, data)
        positions[row] = data.xpos[1:]  # without the world
    return positions
