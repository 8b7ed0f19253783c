"""Warping and equation 11: worked examples, identities and a slow reference."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from getup_jax.motion.clips import MotionError
from getup_jax.motion.dtw import heading_positions, imitation_error, link_distances, warped_cost


def wave(times: np.ndarray) -> np.ndarray:
    """Two links [T, 2, 3] on a circle of radius 1 m and on a line, once a second."""
    angle = 2 * np.pi * times
    circle = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=-1)
    line = np.stack([np.sin(angle), np.zeros_like(angle), np.ones_like(angle)], axis=-1)
    return np.stack([circle, line], axis=1)


def best_path(cost: np.ndarray, open_ends: bool) -> float:
    """By trying every path."""
    rows, columns = cost.shape

    def rest(i: int, j: int) -> float:
        if i == rows - 1:
            return 0.0 if open_ends or j == columns - 1 else np.inf
        steps = [(1, 1, 0.0), (1, 2, 0.0)]
        if i + 2 < rows and j + 1 < columns:
            steps.append((2, 1, cost[i + 1, j + 1]))
        ends = [(i + a, j + b, extra) for a, b, extra in steps if i + a < rows and j + b < columns]
        return min((extra + cost[i2, j2] + rest(i2, j2) for i2, j2, extra in ends), default=np.inf)

    return min(cost[0, j] + rest(0, j) for j in (range(columns) if open_ends else [0]))


def test_equation_11_by_hand():
    motion = np.zeros((1, 1, 2, 3))
    reference = np.array([[[3.0, 4.0, 0.0], [0.0, 0.0, 1.0]]])  # 5 m and 1 m away
    assert link_distances(motion, reference)[0, 0, 0] == pytest.approx(3.0)
    assert imitation_error(motion, reference)[0] == pytest.approx(3.0)


def test_a_path_by_hand():
    cost = np.array([[1.0, 9, 9], [9, 2, 9], [9, 9, 3]])
    assert warped_cost(cost[None], open_ends=False)[0] == pytest.approx(6.0)
    cost = np.array([[1.0, 9, 9], [9, 9, 2]])  # one row, two columns
    assert warped_cost(cost[None], open_ends=False)[0] == pytest.approx(3.0)
    cost = np.array([[1.0, 9], [9, 2], [9, 4]])  # two rows, one column: both pay
    assert warped_cost(cost[None], open_ends=False)[0] == pytest.approx(7.0)


@pytest.mark.parametrize("open_ends", [False, True])
def test_the_recursion_finds_the_best_of_all_paths(open_ends):
    cost = np.random.default_rng(0).uniform(size=(20, 6, 7))
    expected = [best_path(matrix, open_ends) for matrix in cost]
    np.testing.assert_allclose(warped_cost(cost, open_ends), expected)


def test_another_pace_within_the_limits_is_no_error():
    reference = wave(np.arange(60) / 60)
    faster = wave(np.arange(0, 60, 1.5) / 60)  # 1.5 times as fast
    assert imitation_error(faster[None], reference, loop=True)[0] < 0.03
    slower = wave(np.arange(0, 60, 0.75) / 60)
    assert imitation_error(slower[None], reference, loop=True)[0] < 0.03


def test_a_loop_is_matched_from_any_phase_and_beyond_its_seam():
    reference = wave(np.arange(30) / 30)
    longer = wave(0.4 + np.arange(100) / 30)
    assert imitation_error(longer[None], reference, loop=True)[0] == pytest.approx(0.0, abs=1e-9)


def test_standing_still_is_an_error():
    reference = wave(np.arange(30) / 30)
    still = np.repeat(reference[:1], 60, axis=0)
    assert imitation_error(still[None], reference, loop=True)[0] > 0.5


def test_an_offset_is_the_error_itself():
    reference = wave(np.arange(30) / 30)
    moved = reference + np.array([0.0, 0.0, 0.25])
    assert imitation_error(moved[None], reference)[0] == pytest.approx(0.25)


def test_what_cannot_be_matched_is_an_error():
    with pytest.raises(MotionError, match=r"90 frames .* 30 frames .*half to twice"):
        imitation_error(wave(np.arange(90) / 30)[None], wave(np.arange(30) / 30))
    with pytest.raises(MotionError, match=r"same links, got \(1, 30, 1, 3\) and \(30, 2, 3\)"):
        imitation_error(wave(np.arange(30) / 30)[None, :, :1], wave(np.arange(30) / 30))


def test_heading_positions_ignore_where_and_whereto():
    rng = np.random.default_rng(1)
    position = rng.normal(size=(5, 3, 3))
    tilt = Rotation.from_euler("y", rng.uniform(-0.5, 0.5, (5, 1)))
    root = tilt.as_quat(scalar_first=True)
    quaternion = np.repeat(root[:, None], 3, axis=1)
    turn = Rotation.from_euler("z", 2.0)
    moved = np.einsum("ij,flj->fli", turn.as_matrix(), position) + np.array([4.0, -2.0, 0.0])
    turned = np.repeat((turn * tilt).as_quat(scalar_first=True)[:, None], 3, axis=1)
    local = heading_positions(position, quaternion)
    np.testing.assert_allclose(heading_positions(moved, turned), local, atol=1e-12)
    np.testing.assert_allclose(local[:, 0, :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(local[..., 2], position[..., 2])
