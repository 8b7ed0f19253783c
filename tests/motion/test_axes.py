from __future__ import annotations

import numpy as np
import pytest

from getup_jax.motion.retarget.axes import frame_of, shortest_turn


@pytest.mark.parametrize("seed", range(5))
def test_the_shortest_turn_carries_one_direction_to_the_other(seed):
    start, end = np.random.default_rng(seed).normal(size=(2, 3))
    turn = shortest_turn(start, end)
    np.testing.assert_allclose(turn.T @ turn, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(
        turn @ start / np.linalg.norm(start), end / np.linalg.norm(end), atol=1e-12
    )
    across = np.cross(start, end)
    np.testing.assert_allclose(turn @ across, across, atol=1e-9)


@pytest.mark.parametrize("start", [(0, 0, -1), (1, 1, 0), (1, -1, 0), (1, 2, 3)])
def test_half_a_turn_where_the_directions_are_opposite(start):
    turn = shortest_turn(np.array(start, float), -np.array(start, float))
    np.testing.assert_allclose(turn @ start, -np.array(start), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1)


def test_a_frame_keeps_the_exact_axis_and_is_right_handed():
    up, left = np.array([0.1, 0.0, 1.0]), np.array([0.0, 1.0, 0.3])
    for exact, column, given in (("up", 2, up), ("left", 1, left)):
        frame = frame_of(up, left, exact)
        np.testing.assert_allclose(frame[:, column], given / np.linalg.norm(given))
        assert np.linalg.det(frame) == pytest.approx(1)
