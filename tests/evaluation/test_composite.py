from __future__ import annotations

import numpy as np
import pytest

from getup_jax.evaluation.composite import goal_reward


def test_a_goal_pays_nothing_from_a_fall_on():
    reward = np.array([[0.5, 0.5, 0.5, 0.5], [1.0, -3.0, -3.0, 0.25]])
    fell = np.array([[False] * 4, [False, True, True, False]])
    assert goal_reward(reward, fell) == pytest.approx((4 * 0.5 + 1.0) / 8)
