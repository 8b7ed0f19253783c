from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.config import TerrainConfig
from getup_jax.envs.getup.curriculum.regions import (
    RegionProgress,
    advance,
    by_region,
    draw_region,
    first,
)

CONFIG = TerrainConfig(unlock_successes=3)


def run(
    state: RegionProgress, config: TerrainConfig, events: list[tuple[int, int]]
) -> RegionProgress:
    """One step for each (successes, region), in a batch of four."""
    for count, region in events:
        success = jnp.arange(4) < count
        ended, where = jnp.ones(4, bool), jnp.full(4, region, jnp.int32)
        state = advance(state, config, ended, success, where)
    return state


def numbers(state: RegionProgress) -> tuple[int, int, int]:
    return int(state.opened), int(state.successes), int(state.steps)


def test_it_begins_with_the_flat_region():
    assert numbers(first(CONFIG)) == (1, 0, 0)


def test_the_next_region_opens_after_enough_successes_in_the_newest():
    state = run(first(CONFIG), CONFIG, [(2, 0)])
    assert numbers(state) == (1, 2, 1)
    state = run(state, CONFIG, [(1, 0)])
    assert numbers(state) == (2, 0, 2)


def test_successes_in_earlier_regions_do_not_count():
    state = run(first(CONFIG), CONFIG, [(4, 0), (4, 0), (2, 1)])
    assert numbers(state) == (2, 2, 3)


def test_the_last_region_keeps_counting():
    state = run(first(CONFIG), CONFIG, [(4, 0), (4, 1), (4, 2), (4, 3), (4, 3)])
    assert numbers(state) == (4, 8, 5)


def test_the_schedule_opens_a_region_every_so_many_samples():
    config = TerrainConfig(curriculum="schedule", schedule_steps=10)  # 2.5 steps of a batch of 4
    state, seen = first(config), []
    for _ in range(12):
        state = run(state, config, [(4, 0)])
        seen.append(int(state.opened))
    assert seen == [1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, 4]


def test_without_a_curriculum_all_regions_are_open():
    config = TerrainConfig(curriculum="none")
    state = run(first(config), config, [(4, 0)])
    assert int(state.opened) == 4


@pytest.mark.parametrize("opened", [1, 3, 4])
def test_open_regions_are_visited_evenly(opened):
    state = first(CONFIG).replace(opened=jnp.asarray(opened, jnp.int32))
    share = shares(state, 0.0)
    np.testing.assert_allclose(share[:opened], 1 / opened, atol=0.03)
    np.testing.assert_array_equal(share[opened:], 0.0)


def shares(state: RegionProgress, share: float) -> np.ndarray:
    draw = jax.jit(draw_region, static_argnums=(2, 3))
    region = draw(state, jax.random.PRNGKey(0), 4000, share)
    return np.bincount(region, minlength=4) / 4000


def test_regions_that_fail_are_visited_more_often_with_prioritisation():
    rate = jnp.array([1.0, 0.5, 0.0, 0.0])
    state = first(CONFIG).replace(opened=jnp.asarray(3, jnp.int32), rate=rate)
    share = shares(state, 0.9)  # 0.1, 0.55 and 1, and the fourth is closed
    np.testing.assert_allclose(share, np.array([0.1, 0.55, 1.0, 0.0]) / 1.65, atol=0.03)


def test_the_running_success_of_a_region_follows_its_episodes():
    state = first(CONFIG)
    ended = jnp.array([True, True, False, True])
    success = jnp.array([True, False, False, True])
    region = jnp.array([0, 0, 1, 2], jnp.int32)
    for _ in range(300):
        state = advance(state, CONFIG, ended, success, region)
    np.testing.assert_allclose(state.rate, [0.5, 0.0, 1 - 0.99**300, 0.0], atol=0.01)


def test_metrics_of_a_region_are_nan_elsewhere():
    episode = {"success": jnp.array([1.0, 0.0]), "return_rate_lying": jnp.array([0.5, 0.2])}
    metrics = by_region(episode, jnp.array([0, 2]))
    np.testing.assert_array_equal(metrics["success_flat"], [1.0, np.nan])
    np.testing.assert_array_equal(metrics["success_medium"], [np.nan, 0.0])
    np.testing.assert_allclose(metrics["return_rate_lying_medium"], [np.nan, 0.2])
    assert np.isnan(metrics["success_hard"]).all()
    assert len(metrics) == 8
