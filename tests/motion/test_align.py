from __future__ import annotations

import numpy as np

from getup_jax.motion.getup.curve_alignment import FEATURE_SCALE, warp


def ramp(count: int) -> np.ndarray:
    """Features [count, 3] that rise evenly from 0 to 1."""
    return np.tile(np.linspace(0.0, 1.0, count)[:, None], (1, 3))


def test_an_equal_curve_follows_the_clip_frame_by_frame():
    frames, cost = warp(ramp(20), ramp(20))
    np.testing.assert_array_equal(frames, np.arange(20))
    assert cost < 1e-9


def test_a_clip_that_waits_is_left_behind_at_the_right_time():
    clip = np.concatenate([np.zeros((30, 3)), ramp(11)])  # nothing happens for 30 frames
    curve = np.concatenate([np.zeros((10, 3)), ramp(31)])
    frames, _ = warp(curve, clip)
    assert (np.diff(frames) >= 0).all()
    assert (frames[0], frames[-1]) == (0, 40)
    np.testing.assert_allclose(clip[frames], curve, atol=0.06)


def test_the_cost_counts_gaps_in_their_scale():
    clip = ramp(20)
    _, cost = warp(clip + np.array([FEATURE_SCALE[0], 0.0, 0.0]), clip)
    assert 0.5 < cost <= 1.0  # running ahead in the clip would cost angles
