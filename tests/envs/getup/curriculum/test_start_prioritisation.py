from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import changed, tiny_task

from getup_jax.core.masked_update import running_mean
from getup_jax.envs.getup.curriculum import start_prioritisation
from getup_jax.envs.getup.episode import CLIP, LYING, STANDING
from getup_jax.envs.getup.resets.pool import Startable


def test_parts_of_the_curve():
    begin = jnp.asarray([0.0, 0.041, 0.042, 0.99, 1.0, 1.3])
    np.testing.assert_array_equal(start_prioritisation.bin_of(begin), [0, 0, 1, 23, 23, 23])


def test_the_frontier_is_before_what_is_solved_and_where_success_is_uncertain():
    learned = np.zeros((3, 2, start_prioritisation.BINS), np.float32)
    learned[CLIP, 0, 4:] = 1.0
    learned[CLIP, 0, 4] = 0.3
    used = np.ones(learned.shape, bool)
    used[CLIP, 0, 3] = False
    near = np.asarray(start_prioritisation.frontier(jnp.asarray(learned), jnp.asarray(used)))
    # part 4: 4 p (1 - p) = .84 > 1 - .3; the next two parts with starts after 2 are 4 and 5
    np.testing.assert_allclose(near[CLIP, 0, :6], [0, 0.3, 1.0, 1.0, 0.84, 0], atol=1e-6)
    np.testing.assert_allclose(near[LYING, 0], 0.0)  # the first part is hopeless yet
    np.testing.assert_allclose(near[STANDING, 0], 1.0)
    np.testing.assert_allclose(near[CLIP, 1], [0] * (start_prioritisation.BINS - 2) + [1, 1])
    learned[CLIP, 0, 0] = 0.9
    learned[LYING, 0, 0] = 0.2
    near = np.asarray(start_prioritisation.frontier(jnp.asarray(learned), jnp.asarray(used)))
    assert near[LYING, 0, 0] == pytest.approx(0.7)


def test_each_region_has_a_frontier_of_its_own_where_curves_start_everywhere():
    learned = np.zeros((6, 1, start_prioritisation.BINS), np.float32)  # two regions
    learned[2 * CLIP] = 1.0
    used = np.ones(learned.shape, bool)
    first = np.asarray(start_prioritisation.frontier(jnp.asarray(learned), jnp.asarray(used), 2))
    np.testing.assert_allclose(first[2 * LYING : 2 * LYING + 2, 0], 1.0)
    np.testing.assert_allclose(first[2 * CLIP + 1], 1.0)
    own = np.asarray(
        start_prioritisation.frontier(jnp.asarray(learned), jnp.asarray(used), 2, everywhere=True)
    )
    np.testing.assert_allclose(own[2 * LYING, 0], 1.0)
    np.testing.assert_allclose(own[2 * LYING + 1, 0], 0.0)
    np.testing.assert_allclose(own[2 * CLIP], 0.0)
    np.testing.assert_allclose(own[2 * CLIP + 1, 0], [0] * (start_prioritisation.BINS - 2) + [1, 1])
    np.testing.assert_allclose(own[2 * STANDING + 1], 1.0)


def test_weights_follow_the_frontier_of_the_entrys_cell(built):
    pool, duration = built.world.pool, built.world.duration
    learned = start_prioritisation.first(pool).at[STANDING].set(1.0)
    weight = np.asarray(start_prioritisation.weights(learned, pool, duration, 0.8))
    assert weight.shape == pool.table[:, 0].shape
    np.testing.assert_allclose(weight[STANDING], 0.2, atol=1e-6)
    # the clip of one second has frames at 0 and .5, which are all the parts there are
    np.testing.assert_allclose(weight[CLIP, 0], 1.0, atol=1e-6)


def test_even_weights_give_a_style_the_share_of_its_largest_one(built):
    world = built.world
    learned = jnp.full_like(start_prioritisation.first(world.pool), 0.5).at[CLIP, 0, :].set(1.0)
    plain = start_prioritisation.weights(learned, world.pool, world.duration, 0.9)
    even = start_prioritisation.weights(learned, world.pool, world.duration, 0.9, even=True)
    np.testing.assert_allclose(even.sum(axis=-1), plain.max(axis=-1), rtol=1e-5)
    ratio = np.asarray(even / plain)
    np.testing.assert_allclose(ratio, np.broadcast_to(ratio[..., :1], ratio.shape), rtol=1e-5)
    assert float(plain.sum(axis=-1)[CLIP, 1]) > 2.0 * float(even.sum(axis=-1)[CLIP, 1])


def test_draws_are_in_proportion_to_the_weights():
    weight = jnp.asarray(np.random.default_rng(0).uniform(0.1, 1.0, (3, 2, 4)), jnp.float32)
    kind = jnp.tile(jnp.arange(3), 20_000)
    getup, row = map(np.asarray, start_prioritisation.draw(weight, kind, jax.random.PRNGKey(0)))
    for k in range(3):
        mine = np.asarray(kind) == k
        count = np.zeros((2, 4))
        np.add.at(count, (getup[mine], row[mine]), 1)
        np.testing.assert_allclose(count / mine.sum(), weight[k] / weight[k].sum(), atol=0.01)


def test_a_cell_moves_to_its_episodes_results_and_the_others_stay():
    learned = jnp.full((3, 2, start_prioritisation.BINS), 0.5)
    cell = (jnp.asarray([0, 0, 1, 2]), jnp.asarray([0, 0, 1, 1]), jnp.asarray([3, 3, 0, 7]))
    ended = jnp.asarray([True, True, True, False])
    success = jnp.asarray([True, False, True, True])
    after = np.asarray(running_mean(learned, cell, ended, success, start_prioritisation.RATE))
    # one episode after the other, the good one and the bad one in either order, moves as far
    assert after[0, 0, 3] == pytest.approx(0.5)
    assert after[1, 1, 0] == pytest.approx(0.5 + start_prioritisation.RATE * 0.5)
    assert after[2, 1, 7] == 0.5
    assert (np.delete(after.ravel(), [3, 3 * start_prioritisation.BINS]) == 0.5).all()


def test_the_task_follows_the_success_of_its_starts(character):
    config = changed(prioritisation=0.9)
    built = tiny_task(character, config)
    env, world = built.environment, built.world
    state = jax.jit(env.init, static_argnums=2)(world, jax.random.PRNGKey(0), 8)
    assert state.curriculum.success.shape == (3, 2, start_prioritisation.BINS)
    ends = state.duration + config.task.stand_time_s
    learned = state.curriculum.replace(success=state.curriculum.success + 0.5)
    state = state.replace(time=ends, curriculum=learned)
    after, output = jax.jit(env.step)(world, state, jnp.zeros((8, env.action_size)))
    assert bool(output.truncated.all())
    # who started standing stands in this one step, and nobody else does
    moved = np.argwhere(np.asarray(after.curriculum.success) != 0.5)
    value = np.asarray(after.curriculum.success)[tuple(moved.T)]
    np.testing.assert_array_equal(value > 0.5, moved[:, 0] == STANDING)
    assert set(moved[:, 0]) == set(np.asarray(state.kind).tolist())
    assert len(set(moved[:, 0])) > 1


def test_styles_that_cannot_start_in_a_region_have_no_weight(built):
    pool, duration = built.world.pool, built.world.duration
    table = jnp.repeat(pool.table, 2, axis=1)  # two regions
    startable = Startable(styles=jnp.asarray([[0, 1], [1, 0]]), count=jnp.asarray([2, 1]))
    pool = pool.replace(table=table, startable=startable)
    learned = start_prioritisation.first(pool)
    weight = np.asarray(start_prioritisation.weights(learned, pool, duration, 0.0))
    assert weight.shape == (6, 2, table.shape[-1])
    np.testing.assert_array_equal(weight[2 * LYING], 1.0)
    np.testing.assert_array_equal(weight[2 * LYING + 1, 0], 0.0)
    np.testing.assert_array_equal(weight[2 * LYING + 1, 1], 1.0)
    kind, region = jnp.asarray([LYING, STANDING, CLIP]), jnp.asarray([1, 0, 1])
    np.testing.assert_array_equal(
        start_prioritisation.place_of(pool, kind, region), 2 * kind + region
    )
    np.testing.assert_array_equal(start_prioritisation.place_of(pool, kind, None), kind)


def test_short_episodes_end_early_and_say_nothing_about_success(character):
    config = changed(prioritisation=0.9, short_share=0.999, short_s=0.3)
    built = tiny_task(character, config)
    env, world = built.environment, built.world
    state = jax.jit(env.init, static_argnums=2)(world, jax.random.PRNGKey(0), 8)
    short = np.asarray(jnp.isfinite(state.until))
    np.testing.assert_array_equal(short, np.asarray(state.kind) != STANDING)
    assert short.any()
    learned = state.curriculum.replace(success=state.curriculum.success + 0.5)
    time = jnp.where(short, state.until, state.time)
    state = state.replace(time=time, curriculum=learned)
    after, output = jax.jit(env.step)(world, state, jnp.zeros((8, env.action_size)))
    np.testing.assert_array_equal(output.truncated, short)
    assert np.isnan(np.asarray(output.episode["return_rate"])[short]).all()
    np.testing.assert_array_equal(after.curriculum.success, 0.5)
