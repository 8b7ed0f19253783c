"""Which lying bodies a style starts from: those whose torso angles are near its first ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from getup_jax.motion.clips import GetUp
from getup_jax.physics.character import CharacterSpec
from getup_jax.pose_prior.data import pose_conditions


def fits(
    getups: Sequence[GetUp], qpos: np.ndarray, character: CharacterSpec, most_rad: float
) -> np.ndarray:
    """Whether torso angles of poses [N, 7 + J] are near a style's first ones, [N, G] [P 5.2]."""
    angles = pose_conditions(qpos, character)[:, None, 1:]
    first = np.stack([getup.points[0, 1:] for getup in getups])
    return np.abs(angles - first).max(axis=-1) <= most_rad


def least_used(
    fair: np.ndarray, used: np.ndarray, count: int, rng: np.random.Generator
) -> np.ndarray:
    """`count` of the starts where fair [N], first those that fewer styles have: see used [N]."""
    order = rng.permutation(np.flatnonzero(fair))
    chosen = np.resize(order[np.argsort(used[order], kind="stable")], count)
    np.add.at(used, chosen, 1)
    return chosen
