"""The control gain: what it says of responses whose answer is known."""

from __future__ import annotations

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest

from eval_samples import make_policy, make_task
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.evaluation import control_gain
from getup_jax.evaluation.control_gain import (
    EDIT_STD,
    Responses,
    edit_plan,
    edited,
    measure,
    regress,
)
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.curves import NUM_POINTS

DT = 1 / 30
STEPS, EDITS = 120, 40


def smooth(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Random signals [*shape, STEPS] that change over some ten steps."""
    kernel = np.hanning(15)
    raw = rng.normal(size=(math.prod(shape), STEPS))
    return np.stack([np.convolve(row, kernel, "same") for row in raw]).reshape(*shape, STEPS)


def responses(gain, lag: int, noise: float = 0.0, seed: int = 0) -> Responses:
    """Edits of which `gain` [3] is done, `lag` steps later, beside noise of that rms."""
    rng = np.random.default_rng(seed)
    asked = np.moveaxis(smooth(rng, EDITS, 3), -1, 0)
    asked /= np.sqrt((asked**2).mean(axis=(0, 1)))
    late = np.concatenate([np.zeros((lag, EDITS, 3)), asked[: STEPS - lag]])
    done = np.asarray(gain) * late + noise * rng.normal(size=asked.shape)
    length = rng.integers(STEPS // 2, STEPS, EDITS)
    used = np.arange(STEPS)[:, None] < length
    done[~used] = np.nan  # after an episode's end, nothing is looked at
    return Responses(asked, done, used, curves=8)


# What was done of what was asked.


def test_a_known_gain_and_lag_are_found():
    found = control_gain.control_gain(responses((0.5, -0.2, 1.0), lag=3), DT)
    assert list(found) == ["height", "side_angle", "front_angle"]
    assert found["height"].gain_at_lag == pytest.approx(0.5, abs=0.02)
    assert found["height"].correlation_at_lag == pytest.approx(1.0, abs=0.02)
    assert found["height"].lag_s == pytest.approx(0.1)
    assert found["front_angle"].gain_at_lag == pytest.approx(1.0, abs=0.03)
    # without the lag, a part of it is missed
    assert 0.5 * found["height"].gain_at_lag < found["height"].gain < 0.9 * 0.5
    assert found["side_angle"].gain < 0.0


def test_what_is_done_at_once_has_no_lag():
    found = control_gain.control_gain(responses((1.0, 1.0, 0.5), lag=0), DT)
    for name, gain in (("height", 1.0), ("side_angle", 1.0), ("front_angle", 0.5)):
        row = found[name]
        assert (row.lag_s, row.gain_at_lag) == (0.0, row.gain)
        assert row.gain == pytest.approx(gain)
        assert row.correlation == pytest.approx(1.0)
        assert row.done_rms == pytest.approx(gain * row.asked_rms)


def test_noise_lowers_the_correlation_and_not_the_gain():
    row = control_gain.control_gain(responses((0.6, 0.6, 0.6), lag=0, noise=0.8), DT)["height"]
    assert row.gain == pytest.approx(0.6, abs=0.05)
    assert row.correlation == pytest.approx(0.6 / math.hypot(0.6, 0.8), abs=0.05)


def test_the_regression_by_hand():
    gain, correlation = regress(np.array([1.0, -1.0, 2.0]), np.array([1.0, 0.0, 1.0]))
    assert gain == pytest.approx(3 / 6)
    assert correlation == pytest.approx(np.corrcoef([1, -1, 2], [1, 0, 1])[0, 1])


def test_without_an_edit_there_is_no_gain():
    asked = np.zeros(5)
    assert all(math.isnan(x) for x in regress(asked, np.arange(5.0)))
    assert all(math.isnan(x) for x in regress(asked[:0], asked[:0]))
    none = Responses(*np.zeros((2, 4, 2, 3)), np.zeros((4, 2), bool), curves=2)
    row = control_gain.control_gain(none, DT)["height"]
    assert math.isnan(row.gain)
    assert math.isnan(row.asked_rms)


def test_the_interval_covers_the_gain_as_often_as_it_says():
    covered = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        some = responses((0.0, 0.0, 0.0), lag=0, noise=0.3, seed=seed)
        own = np.repeat(0.5 + 0.2 * rng.normal(size=8), EDITS // 8)  # the gain of each curve
        done = own[:, None] * some.asked + some.done
        low, high = control_gain.interval(dataclasses.replace(some, done=done), 0)
        assert high - low < 0.5
        covered += low < 0.5 < high
    assert 28 <= covered <= 40  # of 8 curves a bootstrap says a little less than 95 %


def test_one_curve_has_no_interval():
    some = dataclasses.replace(responses((1.0, 1.0, 1.0), lag=0), curves=1)
    assert all(math.isnan(x) for x in control_gain.interval(some, 0))


# The edits.


def middle() -> np.ndarray:
    """A curve with room on all sides."""
    points = np.tile([0.7, np.pi / 2, np.pi / 2], (NUM_POINTS, 1))
    points[0], points[-1] = (0.1, 1.5, 0.1), (1.4, 1.6, 1.6)
    return points


def test_edits_move_the_inner_points_by_the_std_that_is_said():
    points = middle()
    variants = edited(points, 20_000, np.random.default_rng(0))
    moved = variants - points
    np.testing.assert_array_equal(moved[:, [0, 1, 8]], 0.0)
    std = moved[:, 2:8].std(axis=0)
    np.testing.assert_allclose(std, np.tile(EDIT_STD, (6, 1)), rtol=0.03)
    neighbours = np.corrcoef(moved[:, 3, 0], moved[:, 4, 0])[0, 1]
    assert abs(neighbours) < 0.03
    s = jnp.broadcast_to(jnp.linspace(0.0, 1.0, 101), (2000, 101))
    curve = np.asarray(curves.evaluate(jnp.asarray(moved[:2000, None]), s))
    rms = np.sqrt((curve**2).mean(axis=(0, 1))) * [1.0, 180 / np.pi, 180 / np.pi]
    np.testing.assert_allclose(rms, [0.05, 6.0, 7.0], rtol=0.08)


def test_edits_stay_within_what_bodies_do_or_the_curve_itself_does():
    points = middle()
    points[4] = -0.1, -0.3, 3.5
    variants = edited(points, 2000, np.random.default_rng(0))
    inner = np.delete(variants, 4, axis=1)
    assert inner[..., 0].min() >= 0.05
    assert inner[..., 0].max() <= 1.5
    assert inner[..., 1:].min() >= 0.0
    assert inner[..., 1:].max() <= np.pi
    assert variants[:, 4, 0].min() == -0.1
    assert variants[:, 4, 1].min() == -0.3
    assert variants[:, 4, 2].max() == 3.5


# Episodes.


@pytest.fixture(scope="module")
def task() -> BuiltTask:
    return make_task()


def test_a_plan_has_each_style_and_its_variants_from_one_start(task):
    plan = edit_plan(task, 3, seed=1)
    np.testing.assert_array_equal(plan.getup, [0, 0, 0, 0, 1, 1, 1, 1])
    np.testing.assert_array_equal(plan.row, 0)
    own = np.asarray(task.world.points)
    np.testing.assert_allclose(plan.points[[0, 4]], own, rtol=1e-6)
    assert (plan.points[1:4] != own[0]).any(axis=(1, 2)).all()
    np.testing.assert_array_equal(plan.points, edit_plan(task, 3, seed=1).points)
    assert (plan.points != edit_plan(task, 3, seed=2).points).any()
    second = edit_plan(task, 3, seed=1, styles=[1])
    np.testing.assert_array_equal(second.getup, [1, 1, 1, 1])
    np.testing.assert_array_equal(second.points, plan.points[4:])


def test_a_step_counts_while_variant_and_curve_rise():
    steps = 6
    time = np.tile(np.arange(1.0, 7.0)[:, None], (1, 6))
    running = np.ones((steps, 6), bool)
    running[4:, 0] = False  # the first curve's own episode ends after 4 steps
    running[2:, 1] = False
    duration = np.full((steps, 6), 5.5)
    duration[:, 3:] = 3.5
    target = np.zeros((steps, 6, 3))
    target[:, [1, 2, 4, 5]] = [[[1.0], [2.0], [3.0], [4.0]]]
    rises = running & (time < duration)
    found = control_gain.of_values(2.0 * target, target, rises, 2)
    np.testing.assert_array_equal(found.used.sum(axis=0), [2, 4, 3, 3])
    np.testing.assert_array_equal(found.asked[0, :, 0], [1.0, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(found.done, 2.0 * found.asked)


def test_it_is_measured_for_a_policy(task):
    learner, policy = make_policy(task)
    result = measure(task, learner, policy, edit_plan(task, 2, 0), lambda done: None)
    assert (result.edits, result.curves, result.success) == (2, 2, 0.0)
    height = result.features["height"]
    assert 0.01 < height.asked_rms < 0.1
    assert abs(height.gain) < 1.0
    text = control_gain.table({"mine": result})
    assert "side angle" in text
    assert f"{height.gain:.2f}" in text
    plain = control_gain.to_json(result)
    assert plain["height"]["gain"] == height.gain
