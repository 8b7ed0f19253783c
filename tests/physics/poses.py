"""States to start simulations from."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.physics.character import CharacterSpec


def lying(character: CharacterSpec, count: int, seed: int = 0) -> np.ndarray:
    """Poses [count, 7 + J] just above the floor, prone and supine in turn, any heading."""
    rng = np.random.default_rng(seed)
    pose = np.tile(character.neutral_qpos, (count, 1))
    tilt = np.where(np.arange(count) % 2 == 0, 0.5, -0.5) * np.pi
    down = Rotation.from_rotvec(np.outer(tilt, [0.0, 1.0, 0.0]))
    turn = Rotation.from_rotvec(np.outer(rng.uniform(-np.pi, np.pi, count), [0.0, 0.0, 1.0]))
    pose[:, 2] = 0.25
    pose[:, 3:7] = (turn * down).as_quat(scalar_first=True)
    pose[:, 7:] = clipped(character, pose[:, 7:] + 0.2 * rng.normal(size=(count, 49)))
    return pose


def random_targets(character: CharacterSpec, steps: int, count: int, seed: int = 1) -> np.ndarray:
    """Hinge targets [steps, count, J] that wander through the joint ranges, filtered at 20 %."""
    rng = np.random.default_rng(seed)
    middle = character.neutral_qpos[7:]
    targets = np.empty((steps, count, len(middle)), np.float32)
    filtered = np.zeros(targets.shape[1:])
    for t in range(steps):
        filtered = 0.8 * filtered + 0.2 * rng.normal(scale=1.5, size=filtered.shape)
        targets[t] = clipped(character, middle + filtered)
    return targets


def clipped(character: CharacterSpec, angles: np.ndarray) -> np.ndarray:
    return np.clip(angles, character.joint_lower, character.joint_upper)
