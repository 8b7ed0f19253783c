"""Orientation matrices from directions."""

from __future__ import annotations

import numpy as np


def frame_of(up: np.ndarray, left: np.ndarray, exact: str = "up") -> np.ndarray:
    """Columns forward, left, up: one given axis exact, the other as near as it can be."""
    up, left = up / np.linalg.norm(up), left / np.linalg.norm(left)
    forward = np.cross(left, up)
    forward = forward / np.linalg.norm(forward)
    if exact == "up":
        return np.stack([forward, np.cross(up, forward), up], axis=1)
    return np.stack([forward, left, np.cross(forward, left)], axis=1)


def shortest_turn(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The rotation matrix that carries one direction to another by the shortest way."""
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1 + 1e-9:  # opposite: half a turn about any axis across
        across = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        across = across / np.linalg.norm(across)
        return 2 * np.outer(across, across) - np.eye(3)
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + cross + cross @ cross / (1 + cosine)
