"""The record of an episode and its verdict, by hand."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.envs.getup.episode import (
    CLIP,
    LYING,
    STANDING,
    EpisodeState,
    Record,
    stands,
    update_record,
    verdict,
)

# compiled once; operation by operation takes far longer
update = jax.jit(update_record)
verdict_of = jax.jit(verdict)


def updated(record: Record, height: float, standing: bool, time_left: float, **changes) -> Record:
    """One more step of one episode whose curve ends at 2 m."""
    value = jnp.array([[height, *changes.get("angles", (1.5, 1.5))]])
    target = jnp.array([[changes.get("target", 2.0), 1.5, 1.5]])
    return update(
        record,
        value,
        target,
        final_height=jnp.array([2.0]),
        time_left=jnp.array([time_left]),
        standing=jnp.array([standing]),
        task_reward=jnp.array([changes.get("reward", 0.5)]),
    )


def standing_for(heights: list[float]) -> Record:
    """A standing phase with one height a second; the last second is the last entry."""
    record = Record.empty(1)
    for index, height in enumerate(heights):
        left = float(len(heights) - index - 1)
        record = updated(record, height, standing=True, time_left=left + 0.5)
    return record


def state_of(record: Record, kinds: list[int]) -> EpisodeState:
    fields = dict.fromkeys(EpisodeState.__dataclass_fields__)  # a verdict reads two of them
    return EpisodeState(**{**fields, "record": record, "kind": jnp.array(kinds)})


def test_a_record_of_two_rising_and_one_standing_step():
    record = Record.empty(1)
    record = updated(record, 0.5, False, 5.0, target=0.4, angles=(1.5, 1.3), reward=0.2)
    record = updated(record, 0.9, False, 4.0, target=1.2, angles=(1.1, 1.5), reward=0.3)
    record = updated(record, 1.8, True, 2.0, reward=0.9)
    assert float(record.task_reward[0]) == pytest.approx(1.4)
    assert (int(record.rise_steps[0]), int(record.stand_steps[0])) == (2, 1)
    assert float(record.height_error[0]) == pytest.approx(0.1 + 0.3)
    assert float(record.angle_error[0]) == pytest.approx((0.0 + 0.2) / 2 + (0.4 + 0.0) / 2)
    assert float(record.stand_ratio[0]) == pytest.approx(0.9)
    assert np.isinf(record.last_ratio[0])  # the last second has not begun


def test_the_lowest_height_is_that_of_the_last_second():
    record = updated(Record.empty(1), 0.2, True, 1.5)  # low, but too early to count
    record = updated(record, 1.9, True, 0.9)
    record = updated(record, 1.7, True, 0.5)
    record = updated(record, 2.0, True, 0.1)
    assert float(record.last_ratio[0]) == pytest.approx(0.85)


@pytest.mark.parametrize(
    ("heights", "expected"),
    [
        ([2.0, 2.0, 2.0], True),
        ([1.81, 1.81, 1.81], True),  # 0.905 on average
        ([1.79, 1.79, 1.79], False),  # 0.895 on average
        ([2.0, 2.0, 1.71], True),  # the last second at 0.855
        ([2.0, 2.0, 1.69], False),  # ... at 0.845
        ([1.3, 2.1, 2.1], True),  # late, but 0.917 on average
        ([0.3, 2.1, 2.1], False),
    ],
)
def test_standing_is_85_percent_at_the_end_and_90_on_average(heights, expected):
    assert bool(stands(standing_for(heights))[0]) is expected


def test_an_episode_without_a_standing_phase_does_not_stand():
    assert not bool(stands(Record.empty(1))[0])


def test_a_verdict_goes_to_the_kind_of_its_start():
    record = Record.empty(3)
    tall = jnp.full((3, 3), 2.0)
    record = update(
        record, tall, tall, jnp.full(3, 2.0), jnp.full(3, 0.1), jnp.ones(3, bool), jnp.full(3, 0.5)
    )
    state = state_of(record, [LYING, STANDING, CLIP])
    result = verdict_of(
        state, jnp.array([True, True, False]), full_steps=jnp.array([1.0, 1.0, 10.0])
    )
    np.testing.assert_array_equal(result["success"], [1.0, np.nan, np.nan])
    np.testing.assert_array_equal(result["stand_success"], [np.nan, 1.0, np.nan])
    # it stands, but was not truncated: it ended early
    np.testing.assert_array_equal(result["clip_success"], [np.nan, np.nan, 0.0])
    np.testing.assert_allclose(result["return_rate"], [0.5, 0.5, 0.05])
    np.testing.assert_allclose(result["return_rate_lying"], [0.5, np.nan, np.nan])
    # nothing rose
    assert np.isnan(result["height_error_m"]).all()
    assert np.isnan(result["angle_error_rad"]).all()


def test_errors_are_means_over_the_rise():
    record = updated(Record.empty(1), 0.5, False, 5.0, target=0.4, angles=(1.5, 1.3))
    record = updated(record, 0.9, False, 4.0, target=1.2, angles=(1.1, 1.5))
    record = updated(record, 0.1, True, 2.0)
    result = verdict_of(state_of(record, [LYING]), jnp.array([False]), jnp.array([3.0]))
    assert float(result["height_error_m"][0]) == pytest.approx(0.2)
    assert float(result["angle_error_rad"][0]) == pytest.approx(0.15)
    assert float(result["success"][0]) == 0.0
