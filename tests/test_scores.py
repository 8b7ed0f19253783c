from __future__ import annotations

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from getup_jax.motion.clips import GetUp
from getup_jax.scores import episode_values, score, stand_time, table, to_json, wilson

DT = 0.5
STAND_S = 1.0
KEYS = {
    "success", "success_low", "success_high", "return_rate", "height_error_m", "angle_error_rad",
    "stand_time_s", "jitter", "torque_nm", "energy_j", "episodes", "per_curve",
}  # fmt: skip


def make_trace(heights, running=None, success=True, **changes) -> SimpleNamespace:
    """Episodes [T, N] of curves of 1 s that end at 1 m; times DT, 2 DT, ..."""
    heights = np.asarray(heights, float)
    steps, count = heights.shape
    running = np.ones((steps, count), bool) if running is None else np.asarray(running, bool)
    last = np.zeros((steps, count), bool)
    final = steps - 1 - running[::-1].argmax(axis=0)
    last[final, np.arange(count)] = success
    flat = np.full((steps, count), np.pi / 2)
    fields = {
        "features": np.stack([heights, flat, flat], axis=-1),
        "target": np.stack([np.ones_like(heights), flat, flat], axis=-1),
        "time": np.tile(DT * np.arange(1, steps + 1)[:, None], (1, count)),
        "qpos": np.zeros((steps, count, 9)),
        "qvel": np.zeros((steps, count, 8)),
        "torque": np.zeros((steps, count, 2)),
        "task_reward": np.ones((steps, count)),
        "running": running,
        "success": last,
        "duration": np.full((steps, count), 1.0),
    }
    return SimpleNamespace(**(fields | changes))


def values(trace) -> dict[str, np.ndarray]:
    return episode_values(trace, DT, STAND_S)


def styles(*names: str) -> list[GetUp]:
    return [GetUp(name, 1.0, np.zeros((9, 3))) for name in names]


# The interval.


def test_wilson_of_8_in_10():
    # a textbook value (Brown, Cai and DasGupta 2001)
    low, high = wilson(8, 10)
    assert (low, high) == (pytest.approx(0.4902, abs=1e-4), pytest.approx(0.9433, abs=1e-4))


def test_wilson_of_none_and_all():
    # z^2 / (n + z^2) with z = 1.96
    edge = 3.8415 / (100 + 3.8415)
    assert wilson(0, 100) == (pytest.approx(0.0, abs=1e-12), pytest.approx(edge, abs=1e-5))
    assert wilson(100, 100) == (pytest.approx(1 - edge, abs=1e-5), pytest.approx(1.0))


def test_wilson_is_symmetric_and_grows_with_the_confidence():
    low, high = wilson(30, 100)
    other_low, other_high = wilson(70, 100)
    assert (other_low, other_high) == (pytest.approx(1 - high), pytest.approx(1 - low))
    wide = wilson(30, 100, confidence=0.99)
    assert wide[0] < low < 0.3 < high < wide[1]


def test_wilson_without_trials_is_unknown():
    assert all(math.isnan(x) for x in wilson(0, 0))


# One number an episode.


def test_stand_time_is_that_of_the_last_low_height():
    # low until 1.0 s; low, up, low again at 1.5 s; never low; always low
    heights = np.array(
        [
            [0.2, 0.2, 0.95, 0.2],
            [0.8, 0.95, 0.95, 0.3],
            [0.95, 0.85, 1.0, 0.4],
            [1.0, 1.0, 1.0, 0.5],
        ]
    )
    np.testing.assert_allclose(stand_time(make_trace(heights)), [1.0, 1.5, 0.0, 2.0])


def test_stand_time_ignores_what_comes_after_the_end():
    heights = np.array([[0.2], [1.0], [0.1]])
    running = np.array([[1], [1], [0]])
    np.testing.assert_allclose(stand_time(make_trace(heights, running)), [0.5])


def test_stand_time_counts_successes_only():
    trace = make_trace(np.full((3, 2), 1.0), success=np.array([True, False]))
    np.testing.assert_allclose(values(trace)["stand_time_s"], [0.0, np.nan])


def test_tracking_errors_are_means_over_the_rise_of_a_running_episode():
    heights = np.array([[0.9, 0.9], [0.7, 0.7], [0.0, 0.0]])  # the third is in the standing phase
    running = np.array([[1, 1], [1, 0], [1, 0]])
    trace = make_trace(heights, running)
    trace.features[0, :, 1] += 0.4  # one of the two angles
    got = values(trace)
    np.testing.assert_allclose(got["height_error_m"], [0.2, 0.1])
    np.testing.assert_allclose(got["angle_error_rad"], [0.1, 0.2])


def test_an_episode_that_never_rises_has_no_tracking_error():
    trace = make_trace(np.ones((2, 1)), time=np.full((2, 1), 5.0))
    assert np.isnan(values(trace)["height_error_m"]).all()


def test_return_rate_divides_by_the_full_episode():
    # 1 s of curve and 1 s of standing are four steps; the second episode ended after one
    running = np.array([[1, 1], [1, 0], [1, 0], [1, 0]])
    reward = np.array([[0.5, 0.5], [0.5, 9.0], [1.0, 9.0], [1.0, 9.0]])
    trace = make_trace(np.ones((4, 2)), running, task_reward=reward)
    np.testing.assert_allclose(values(trace)["return_rate"], [0.75, 0.125])


def test_full_episodes_have_the_steps_that_the_task_gives_them():
    # the task truncates at the control step nearest to the end: the fourth of 0.5 s for 2.1 s
    trace = make_trace(np.ones((4, 1)), duration=np.full((4, 1), 1.1))
    np.testing.assert_allclose(values(trace)["return_rate"], [1.0])


def test_torque_and_energy():
    torque, qvel = np.zeros((2, 2, 2)), np.zeros((2, 2, 8))
    torque[:, 0] = [3.0, -1.0]
    qvel[:, 0, 6:] = [2.0, 4.0]
    qvel[:, :, :6] = 100.0  # the root does no work
    torque[:, 1], qvel[:, 1, 6:] = torque[:, 0], qvel[:, 0, 6:]
    running = np.array([[1, 1], [1, 0]])
    got = values(make_trace(np.ones((2, 2)), running, torque=torque, qvel=qvel))
    np.testing.assert_allclose(got["torque_nm"], [2.0, 2.0])
    # (3 * 2 + 1 * 4) W for one second and for half a second
    np.testing.assert_allclose(got["energy_j"], [10.0, 5.0])


def test_jitter_of_a_cubic_is_its_third_derivative():
    # angle t^3 has the rate 3 t^2 and the jerk 6; the other hinge is still
    time = DT * np.arange(6)
    qvel = np.zeros((6, 1, 8))
    qvel[:, 0, 6] = 3 * time**2
    np.testing.assert_allclose(values(make_trace(np.ones((6, 1)), qvel=qvel))["jitter"], [3.0])


# Scores.


def test_scores_are_means_by_style_and_in_total():
    heights = np.tile([0.9, 0.8, 0.6, 1.0], (2, 1))
    trace = make_trace(heights, success=np.array([True, False, True, True]))
    scores = score(trace, np.array([0, 1, 0, 1]), styles("a", "b", "unused"), DT, STAND_S)
    assert scores.success == pytest.approx(0.75)
    assert scores.episodes == 4
    assert scores.height_error_m == pytest.approx(0.175)
    assert set(scores.per_curve) == {"a", "b"}
    assert scores.per_curve["a"].success == pytest.approx(1.0)
    assert scores.per_curve["b"].success == pytest.approx(0.5)
    assert scores.per_curve["a"].height_error_m == pytest.approx(0.25)
    assert scores.per_curve["b"].episodes == 2
    assert (scores.success_low, scores.success_high) == wilson(3, 4)


def test_json_has_every_score_and_no_nan():
    trace = make_trace(np.full((3, 2), 0.5), success=False)
    result = to_json(score(trace, np.array([0, 1]), styles("a", "b"), DT, STAND_S))
    assert set(result) == KEYS
    assert set(result["per_curve"]) == {"a", "b"}
    assert set(result["per_curve"]["a"]) == KEYS - {"per_curve"}
    assert result["stand_time_s"] is None  # nothing stood
    assert result["success"] == 0.0
    text = json.dumps(result, allow_nan=False)
    assert json.loads(text) == result


def test_the_table_has_a_row_a_style_and_one_in_total():
    trace = make_trace(np.ones((3, 3)), success=np.array([True, True, False]))
    text = table(score(trace, np.array([0, 0, 1]), styles("fast", "slow"), DT, STAND_S))
    rows = {line.split("│")[1].strip(): line for line in text.splitlines() if "│" in line}
    assert {"fast", "slow", "all"} <= set(rows)
    assert "100%" in rows["fast"]
    assert "67%" in rows["all"]
    assert "nan" in rows["slow"]  # no stand time
