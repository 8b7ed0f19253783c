"""Which frame of a motion looks most like a curve at each of its times: dynamic time warping."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

FEATURE_SCALE = np.array([0.1, 0.35, 0.35])  # m, rad, rad: gaps of this size count alike
_FASTEST = 4.0  # times the even pace that a warp may run through the motion
_PACE_COST = 0.02  # of one frame more or less than the even pace


def warp(curve: np.ndarray, clip: np.ndarray) -> tuple[np.ndarray, float]:
    """Frames of a clip, never backwards, whose features are nearest to a curve's samples.

    Args:
        curve: [N, 3] features at even times of the curve: height (m), side and front angle (rad).
        clip: [F, 3] features of the clip's frames.

    Returns:
        Frames [N] int, from the first to the last one, and the mean cost of a sample, where 1 is
        a gap of FEATURE_SCALE in one feature.
    """
    gap = (np.abs(curve[:, None] - clip[None]) / FEATURE_SCALE).sum(axis=-1)
    pace = (len(clip) - 1) / (len(curve) - 1)
    steps = np.arange(int(np.ceil(_FASTEST * pace)) + 1)
    price = _PACE_COST * np.abs(steps - pace) / max(pace, 1.0)
    total = np.full(gap.shape, np.inf)  # cost of the best way to a frame
    taken = np.zeros(gap.shape, int)  # its last step
    total[0, 0] = gap[0, 0]
    padded = np.full(len(steps) - 1 + len(clip), np.inf)  # nothing comes before the first frame
    before = sliding_window_view(padded, len(steps))[:, ::-1]  # [F, S] cost of S steps ago
    for row in range(1, len(curve)):
        padded[len(steps) - 1 :] = total[row - 1]
        cost = before + price
        taken[row] = cost.argmin(axis=1)
        total[row] = gap[row] + cost.min(axis=1)
    frames = np.empty(len(curve), int)
    frames[-1] = len(clip) - 1
    for row in range(len(curve) - 1, 0, -1):
        frames[row - 1] = frames[row] - taken[row, frames[row]]
    return frames, float(total[-1, -1] / len(curve))
