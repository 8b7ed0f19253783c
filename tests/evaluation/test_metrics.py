from __future__ import annotations

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from getup_jax.envs.getup.episode import STANDING
from getup_jax.evaluation.ground_kinds import Places
from getup_jax.evaluation.metrics import episode_values, score, stand_time, to_json, wilson
from getup_jax.evaluation.table import table
from getup_jax.motion.clips import GetUp

DT = 0.5
STAND_S = 1.0
KEYS = {
    "success", "success_low", "success_high", "return_rate", "return_rate_total",
    "height_error_m", "angle_error_rad",
    "stand_time_s", "jitter", "torque_nm", "energy_j", "saturation", "offset_rad", "foot_slip_m_s",
    "penetration_m", "penetration_max_m", "reference_error_m", "success_pushed", "episodes",
    "per_orientation", "per_curve", "per_region", "per_ground",
}  # fmt: skip
GROUPS = {"per_orientation", "per_curve", "per_region", "per_ground"}
STEP_VALUES = ("torque", "power", "jerk", "saturation", "offset", "slip", "penetration")


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
        **{name: np.zeros((steps, count)) for name in STEP_VALUES},
        "pushed": np.zeros((steps, count), bool),
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


def test_energy_is_the_power_over_the_time_of_the_episode():
    running = np.array([[1, 1], [1, 0]])
    got = values(make_trace(np.ones((2, 2)), running, power=np.full((2, 2), 10.0)))
    np.testing.assert_allclose(got["energy_j"], [10.0, 5.0])


@pytest.mark.parametrize(
    ("step_value", "score_name"),
    [
        ("torque", "torque_nm"),
        ("jerk", "jitter"),
        ("saturation", "saturation"),
        ("offset", "offset_rad"),
        ("slip", "foot_slip_m_s"),
        ("penetration", "penetration_m"),
    ],
)
def test_naturalness_is_a_mean_over_the_known_steps_of_the_episode(step_value, score_name):
    value = np.array([[np.nan, np.nan, np.nan], [1.0, 2.0, np.nan], [3.0, 9.0, 9.0]])
    running = np.array([[1, 1, 1], [1, 1, 1], [1, 0, 0]])
    got = values(make_trace(np.ones((3, 3)), running, **{step_value: value}))
    np.testing.assert_allclose(got[score_name], [2.0, 2.0, np.nan])


def test_the_deepest_overlap_is_the_largest_of_all_episodes():
    depth = np.array([[0.01, 0.002], [np.nan, 0.05]])
    running = np.array([[1, 1], [1, 0]])
    trace = make_trace(np.ones((2, 2)), running, penetration=depth)
    np.testing.assert_allclose(values(trace)["penetration_max_m"], [0.01, 0.002])
    scores = score(values(trace), np.array([0, 1]), styles("a", "b"))
    assert scores.penetration_max_m == pytest.approx(0.01)
    assert scores.penetration_m == pytest.approx(0.006)
    assert scores.per_curve["b"].penetration_max_m == pytest.approx(0.002)


def test_success_of_pushed_episodes_leaves_the_others_out():
    pushed = np.zeros((3, 4), bool)
    pushed[1] = [True, True, False, True]
    running = np.array([[1, 1, 1, 1], [1, 1, 1, 0], [1, 1, 1, 0]])  # the last fell before its push
    success = np.array([True, False, True, False])
    trace = make_trace(np.ones((3, 4)), running, success=success, pushed=pushed)
    np.testing.assert_allclose(values(trace)["success_pushed"], [1.0, 0.0, np.nan, np.nan])


# Scores.


def test_scores_are_means_by_style_and_in_total():
    heights = np.tile([0.9, 0.8, 0.6, 1.0], (2, 1))
    trace = make_trace(heights, success=np.array([True, False, True, True]))
    scores = score(values(trace), np.array([0, 1, 0, 1]), styles("a", "b", "unused"))
    assert scores.success == pytest.approx(0.75)
    assert scores.episodes == 4
    assert scores.height_error_m == pytest.approx(0.175)
    assert set(scores.per_curve) == {"a", "b"}
    assert scores.per_curve["a"].success == pytest.approx(1.0)
    assert scores.per_curve["b"].success == pytest.approx(0.5)
    assert scores.per_curve["a"].height_error_m == pytest.approx(0.25)
    assert scores.per_curve["b"].episodes == 2
    assert (scores.success_low, scores.success_high) == wilson(3, 4)


def test_scores_by_the_way_of_lying():
    lying = styles("back", "belly", "left", "right")
    for style, front, side in zip(lying, (0.1, 3.0, 1.5, 1.6), (1.5, 1.5, 0.2, 2.9), strict=True):
        style.points[0, 1:] = side, front
    trace = make_trace(np.ones((3, 5)), success=np.array([True, False, True, False, True]))
    style = np.array([0, 1, 2, 3, 0])
    scores = score(values(trace), style, lying)
    found = {name: (x.episodes, x.success) for name, x in scores.per_orientation.items()}
    assert found == {"supine": (2, 1.0), "prone": (1, 0.0), "side": (2, 0.5)}
    assert score(values(trace), style, lying, STANDING).per_orientation is None


def test_the_total_return_rate_counts_long_episodes_for_more():
    # of full episodes of 4 and 2 steps, all of the first and half of the second
    trace = make_trace(np.ones((4, 2)), np.array([[1, 1], [1, 0], [1, 0], [1, 0]]))
    trace.duration[:, 1] = 0.0
    scores = score(values(trace), np.array([0, 1]), styles("long", "short"))
    assert scores.return_rate == pytest.approx((4 / 4 + 1 / 2) / 2)
    assert scores.return_rate_total == pytest.approx((4 + 1) / (4 + 2))
    assert scores.per_curve["short"].return_rate_total == pytest.approx(1 / 2)


def test_scores_by_region_and_kind_of_ground():
    trace = make_trace(np.ones((3, 4)), success=np.array([True, False, True, False]))
    region = np.array(["flat", "flat", "hard", "easy"])
    kind = np.array(["flat ground", "flat ground", "slope 20-30°", "rough"])
    places = Places(region, kind)
    scores = score(values(trace), np.zeros(4, int), styles("a"), places=places)
    grounds = {name: (x.episodes, x.success) for name, x in scores.per_ground.items()}
    assert grounds == {"flat ground": (2, 0.5), "rough": (1, 0.0), "slope 20-30°": (1, 1.0)}
    found = {name: (x.episodes, x.success) for name, x in scores.per_region.items()}
    assert found == {"flat": (2, 0.5), "easy": (1, 0.0), "hard": (1, 1.0)}
    assert (scores.per_region["flat"].success_low, scores.per_region["flat"].success_high) == (
        wilson(1, 2)
    )
    assert set(to_json(scores)["per_region"]["hard"]) == KEYS - GROUPS
    assert {"flat", "easy", "hard", "rough", "slope 20-30°"} <= rows_of(table(scores)).keys()


def test_json_has_every_score_and_no_nan():
    trace = make_trace(np.full((3, 2), 0.5), success=False)
    result = to_json(score(values(trace), np.array([0, 1]), styles("a", "b")))
    assert set(result) == KEYS
    assert set(result["per_curve"]) == {"a", "b"}
    assert set(result["per_curve"]["a"]) == KEYS - GROUPS
    assert set(result["per_orientation"]["supine"]) == KEYS - GROUPS
    assert result["stand_time_s"] is None  # nothing stood
    assert result["success"] == 0.0
    text = json.dumps(result, allow_nan=False)
    assert json.loads(text) == result


def rows_of(text: str) -> dict[str, list[str]]:
    """{first cell: lines} of the tables."""
    rows: dict[str, list[str]] = {}
    for line in text.splitlines():
        if line.startswith("│"):
            rows.setdefault(line.split("│")[1].strip(), []).append(line)
    return rows


def test_the_tables_have_a_row_a_style_a_way_of_lying_and_one_in_total():
    trace = make_trace(np.ones((3, 3)), success=np.array([True, True, False]))
    trace.slip[:] = 0.123
    text = table(score(values(trace), np.array([0, 0, 1]), styles("fast", "slow")))
    rows = rows_of(text)
    assert list(rows) == ["fast", "slow", "supine", "all"]
    assert "100%" in rows["fast"][0]
    assert "67%" in rows["all"][0]
    assert "0%" in rows["slow"][0]
    assert " - " in rows["slow"][0]  # no stand time
    assert all("0.123" in lines[1] for lines in rows.values())
    assert "pushed" not in text


def test_the_table_tells_of_pushes_where_there_were_some():
    pushed = np.zeros((3, 2), bool)
    pushed[1] = True
    trace = make_trace(np.ones((3, 2)), success=np.array([True, False]), pushed=pushed)
    text = table(score(values(trace), np.array([0, 0]), styles("a")))
    assert "of pushed" in text
    assert rows_of(text)["a"][0].count("50%") == 2  # of all, and of pushed
