"""Imitation error of a body group: link distances after dynamic time warping [C, equation 11].

The warping lets a motion run at half to twice the reference's pace, locally too. The unlimited
one of the paper's library lets a character that stands still match its nearest frame for ever.
The recursion only looks at earlier rows, so that NumPy does a row of all episodes at once, and
no library is needed.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.motion.clips import MotionError


def imitation_error(motion: np.ndarray, reference: np.ndarray, loop: bool = False) -> np.ndarray:
    """Mean over the frames of equation 11, after warping: [B] (m).

    motion [B, T, N, 3] and reference [S, N, 3] (m) are link positions in the same frame of
    reference and at the same rate. With `loop` the reference repeats and may start anywhere;
    otherwise both begin and end together. Raises MotionError where they cannot be matched.
    """
    motion, reference = np.asarray(motion, np.float64), np.asarray(reference, np.float64)
    if motion.ndim != 4 or reference.ndim != 3 or motion.shape[2:] != reference.shape[1:]:
        raise MotionError(
            "imitation_error: expected link positions [B, T, N, 3] and [S, N, 3] of the same "
            f"links, got {motion.shape} and {reference.shape}"
        )
    frames, length = motion.shape[1], len(reference)
    cost = link_distances(motion, reference)
    if loop:  # long enough for twice the pace from any start
        cost = np.tile(cost, (1, 1, 1 + -(-2 * frames // length)))
    total = warped_cost(cost, open_ends=loop)
    if not np.isfinite(total[np.isfinite(cost).all(axis=(1, 2))]).all():
        raise MotionError(
            f"imitation_error: a motion of {frames} frames cannot be matched with {length} frames "
            "at half to twice the pace; cut the longer one, or pass loop for a cyclic reference"
        )
    return total / frames


def link_distances(motion: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Equation 11 between all pairs of frames: [B, T, S] (m)."""
    links = motion.shape[2]
    total = np.zeros((*motion.shape[:2], len(reference)))
    for link in range(links):
        gap = motion[:, :, None, link] - reference[None, None, :, link]
        total += np.sqrt(np.sum(gap * gap, axis=-1))
    return total / links


def warped_cost(cost: np.ndarray, open_ends: bool) -> np.ndarray:
    """Least sum of cost [B, T, S] along a path with a term for each of the T rows: [B].

    A step goes one row and one column on, or one row and two columns (the skipped column costs
    nothing), or two rows and one column (both rows pay). `open_ends`: the path may begin and end
    in any column. Infinite where there is no path.
    """
    batch, rows, columns = cost.shape
    before = np.full((batch, columns), np.inf)
    row = cost[:, 0].copy()
    if not open_ends:
        row[:, 1:] = np.inf
    for i in range(1, rows):
        here = cost[:, i]
        best = np.full((batch, columns), np.inf)
        best[:, 1:] = np.minimum(row[:, :-1], before[:, :-1] + cost[:, i - 1, 1:])
        best[:, 2:] = np.minimum(best[:, 2:], row[:, :-2])
        before, row = row, best + here
    return row.min(axis=1) if open_ends else row[:, -1]


def heading_positions(position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Link positions [..., L, 3] without the root's place on the floor and its heading (m).

    quaternion [..., L, 4] (wxyz), the root first; heading as in `rotation.heading`.
    """
    moved = position - position[..., :1, :] * [1.0, 1.0, 0.0]
    yaw = 2.0 * np.arctan2(quaternion[..., 0, 3], quaternion[..., 0, 0])
    back = Rotation.from_euler("z", -yaw.reshape(-1, 1)).as_matrix()
    moved = moved.reshape(-1, *position.shape[-2:])
    return np.einsum("fij,flj->fli", back, moved).reshape(position.shape)
