from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from ground_samples import TERRAIN, deepest_contact
from tiny_task import CONFIG, changed, getups, neutral_prior

from getup_jax.config import ConfigError
from getup_jax.envs.getup import terminations
from getup_jax.envs.getup.build import assemble
from getup_jax.envs.getup.episode import CLIP, LYING, STANDING
from getup_jax.envs.getup.resets import lying_bodies as limp
from getup_jax.envs.getup.resets import region_pool
from getup_jax.physics.character import load_character
from getup_jax.physics.native import NativeEngine
from getup_jax.physics.surface import link_gaps
from getup_jax.pose_prior.data import pose_conditions

SETTINGS = changed(stand_start=0.3, reference_start=0.2, pool_size=120)
TASK = SETTINGS.task
ROWS = 5  # 120 over three kinds, four regions and two styles


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("starts")


def uneven_task(character, cache, config=SETTINGS, of=None):
    """A get-up task on the small irregular ground."""
    config = dataclasses.replace(config, terrain=TERRAIN)
    with pytest.MonkeyPatch.context() as patch:
        for module in (region_pool, limp):
            patch.setattr(module, "cache_dir", lambda: cache)
        styles = getups(character) if of is None else of
        return assemble(config, character, styles, neutral_prior(character), print)


@pytest.fixture(scope="module")
def uneven(character, cache):
    return uneven_task(character, cache)


def rows(task, kind: int, region: int, style: int) -> np.ndarray:
    pool = task.world.pool
    return np.asarray(pool.physics.kinematics.qpos)[np.asarray(pool.table[kind, region, style])]


def test_every_kind_region_and_style_has_its_rows(uneven):
    pool = uneven.world.pool
    assert pool.table.shape == (3, 4, 2, ROWS)
    assert int(pool.table.max()) == len(pool.time) - 1
    np.testing.assert_array_equal(pool.startable.count, 2)


@pytest.mark.parametrize("region", range(4))
def test_starts_lie_in_their_region_and_on_the_ground(uneven, site, region):
    for kind in (LYING, STANDING):
        qpos = np.concatenate([rows(uneven, kind, region, style) for style in range(2)])
        np.testing.assert_array_equal(site.ground.region(qpos[:, :2]), region)
        gap = deepest_contact(site.character, qpos)
        assert gap.min() > -0.02
        assert gap.max() < 0.01


def test_motions_recorded_far_from_the_origin_start_in_the_flat_region_too(character, cache, site):
    def moved(getup):
        if getup.clip is None:
            return getup
        qpos = getup.clip.qpos + np.eye(7 + 49)[0] * 50.0  # m, of the root
        return dataclasses.replace(getup, clip=dataclasses.replace(getup.clip, qpos=qpos))

    far = [moved(getup) for getup in getups(character)]
    assert any(getup.clip is not None for getup in far)
    built = uneven_task(character, cache, of=far)
    for kind in (LYING, CLIP):
        for style in range(2):
            xy = rows(built, kind, 0, style)[:, :2]
            np.testing.assert_array_equal(site.ground.region(xy), 0)


def test_lying_starts_fit_their_curve(uneven, site):
    for region in range(1, 4):
        for style, getup in enumerate(uneven.getups):
            angles = pose_conditions(rows(uneven, LYING, region, style), site.character)[:, 1:]
            assert np.abs(angles - getup.points[0, 1:]).max() <= TASK.curve_match_rad


def test_the_flat_region_has_limp_bodies_only_if_asked(uneven, site, character, cache):
    own = np.abs(rows(uneven, LYING, 0, 0)[:, 7:] - site.character.neutral_qpos[7:])
    assert own.sum(axis=1).max() < 3.0
    built = uneven_task(character, cache, changed(SETTINGS, limp_share=0.6, limp_drops=30))
    for style, getup in enumerate(built.getups):
        qpos = rows(built, LYING, 0, style)
        limp = np.abs(qpos[:, 7:] - site.character.neutral_qpos[7:]).sum(axis=1) > 3.0
        assert limp.sum() == 3  # of 5 rows
        np.testing.assert_array_equal(site.ground.region(qpos[:, :2]), 0)
        angles = pose_conditions(qpos, site.character)[:, 1:]
        assert np.abs(angles - getup.points[0, 1:]).max() <= TASK.curve_match_rad
        for region in range(1, 4):  # where all are limp in any case
            same = rows(uneven, LYING, region, style)
            np.testing.assert_array_equal(rows(built, LYING, region, style), same)


def test_times_are_those_of_the_kind(uneven):
    pool = uneven.world.pool
    time = np.asarray(pool.time)[np.asarray(pool.table)]
    np.testing.assert_array_equal(time[LYING], 0.0)
    np.testing.assert_array_equal(time[STANDING, :, 1], 2.0)
    np.testing.assert_array_equal(time[CLIP, 1:], 0.0)  # only the flat region has a clip


def test_every_region_has_starts_along_the_clip_if_asked(character, site, cache):
    config = changed(SETTINGS, reference_everywhere=True)
    built = uneven_task(character, cache, config)
    pool = built.world.pool
    time = np.asarray(pool.time)[np.asarray(pool.table)]
    np.testing.assert_array_equal(time[CLIP, 1:], np.repeat(time[CLIP, :1], 3, axis=0))
    assert time[CLIP, :, 0].max() > 0.0
    for region in range(1, 4):
        qpos = np.concatenate([rows(built, CLIP, region, style) for style in range(2)])
        np.testing.assert_array_equal(site.ground.region(qpos[:, :2]), region)
        flat = np.concatenate([rows(built, CLIP, 0, style) for style in range(2)])
        np.testing.assert_allclose(qpos[:, 7:], flat[:, 7:], atol=1e-6)
    state = built.environment.init(built.world, jax.random.PRNGKey(0), 512)
    state = state.curriculum.regions.replace(opened=jnp.asarray(4, jnp.int32))
    aids = built.environment.curriculum
    kind, region = aids._places(jax.random.PRNGKey(0), 2000, state)
    share = np.asarray(kind == CLIP)[np.asarray(region) > 0].mean()
    assert share == pytest.approx(aids.config.reference_start, abs=0.04)


def test_a_style_that_nothing_fits_is_left_out_of_the_region(uneven, site, cache, monkeypatch):
    for module in (region_pool, limp):
        monkeypatch.setattr(module, "cache_dir", lambda: cache)
    clip, curve = getups(site.character)
    odd = curve.points.copy()
    odd[0, 1:] = np.pi / 2, np.pi / 2  # no rag-doll lies upright
    styles, log = [clip, dataclasses.replace(curve, points=odd, clip=clip.clip)], []
    engine = NativeEngine(site.character, CONFIG.physics)
    flat = region_pool.FlatStarts(
        [clip, clip], load_character(CONFIG.physics), TASK, SETTINGS.training_aids, 0, 65
    )
    pool = region_pool.build_region_pool(styles, flat, site, engine, TASK, log.append)
    np.testing.assert_array_equal(pool.startable.count, [2, 1, 1, 1])
    np.testing.assert_array_equal(pool.startable.styles[1:, 0], 0)
    assert any("'easy' fits curve" in line for line in log)
    none = [dataclasses.replace(style, points=odd) for style in styles]
    with pytest.raises(ConfigError, match=r"no rag-doll in the region 'easy'.*0\.52"):
        region_pool.build_region_pool(none, flat, site, engine, TASK, log.append)


def test_an_evaluation_visits_regions_and_styles_in_turn(uneven):
    style, row, region = region_pool.region_starts(uneven.world.pool, 24)
    np.testing.assert_array_equal(region, np.tile([0, 1, 2, 3], 6))
    np.testing.assert_array_equal(style[region == 3], [0, 1, 0, 1, 0, 1])
    np.testing.assert_array_equal(row[region == 3], [0, 0, 1, 1, 2, 2])


def test_an_evaluation_leaves_out_styles_that_cannot_start(uneven):
    startable = uneven.world.pool.startable
    fewer = startable.replace(
        styles=startable.styles.at[2].set(jnp.array([1, 0])), count=startable.count.at[2].set(1)
    )
    pool = uneven.world.pool.replace(startable=fewer)
    style, row, region = region_pool.region_starts(pool, 4 * ROWS + 4)
    np.testing.assert_array_equal(style[region == 2], 1)
    np.testing.assert_array_equal(row[region == 2], [*range(ROWS), 0])


# The task on irregular ground.


def at(task, kind: int, region: int, count: int = 4):
    """Episodes [count] of the first style in a region."""
    kinds, regions = (np.full(count, x, np.int32) for x in (kind, region))
    return _starts(task.environment, task.world, kinds, regions)


@functools.partial(jax.jit, static_argnums=0)
def _starts(env, world, kind, region):
    row = jnp.arange(len(kind), dtype=jnp.int32) % ROWS
    return env.start(world, jnp.zeros_like(kind), kind, row, region=region)


def test_heights_are_above_the_mean_of_the_height_map(uneven, site):
    field = site.ground.field()
    state = at(uneven, STANDING, 3)
    qpos = np.asarray(state.physics.kinematics.qpos)
    posture = uneven.environment.observer.posture(state.physics.kinematics, uneven.world.terrain)
    under = qpos[:, 2] - field.height(qpos[:, :2])
    middle = np.asarray(posture.height_map)[:, 12]
    np.testing.assert_allclose(middle, under, atol=1e-4)
    neck = site.character.link("neck")
    mean = qpos[:, 2] - np.asarray(posture.height_map).mean(axis=1)
    height = np.asarray(state.physics.kinematics.link_position)[:, neck, 2] - mean
    np.testing.assert_allclose(posture.features[:, 0], height, atol=1e-4)
    assert np.ptp(np.asarray(posture.height_map), axis=1).min() > 0.05  # it is not flat


def test_the_first_servo_target_is_the_start_pose_itself(uneven):
    env, world = uneven.environment, uneven.world
    state = at(uneven, STANDING, 3)
    pose = np.asarray(state.physics.kinematics.qpos)[:, 7:]
    np.testing.assert_allclose(env.servo_target(world, state, state.action), pose, atol=1e-5)
    assert np.abs(np.asarray(state.action)[:, -env.character.num_joints :]).max() > 0.1


def test_the_head_is_on_the_floor_where_it_touches_the_slope(uneven, site):
    env, field = uneven.environment, site.ground.field()
    state = at(uneven, LYING, 3)
    link = site.character.head_sphere[0]
    kinematics = state.physics.kinematics
    gap = np.asarray(terminations.head_gap(env.character, uneven.world.terrain, kinematics))
    qpos = np.asarray(kinematics.qpos)
    np.testing.assert_allclose(gap, link_gaps(site.character, field, qpos)[:, link], atol=1e-4)


def test_a_training_step_counts_successes_and_opens_regions(uneven):
    env, world = uneven.environment, uneven.world
    quick = dataclasses.replace(TERRAIN, unlock_successes=1)
    env = env.with_terrain(quick)
    state = jax.jit(env.init, static_argnums=2)(world, jax.random.PRNGKey(0), 8)
    np.testing.assert_array_equal(state.region, 0)
    step = jax.jit(env.step)
    state, output = step(world, state, state.action)
    assert int(state.curriculum.regions.steps) == 1
    np.testing.assert_array_equal(output.metrics["regions_open"], 1.0)
    # episodes that began lying and are about to end, standing as they should
    end = state.duration + env.config.stand_time_s - 0.01
    record = state.record.replace(
        stand_ratio=jnp.full(8, 60.0),
        stand_steps=jnp.full(8, 60, jnp.int32),
        last_ratio=jnp.ones(8),
    )
    zero = jnp.zeros(8, jnp.int32)
    standing = at(uneven, STANDING, 0, 8)
    state = state.replace(
        physics=standing.physics, action=standing.action, time=end, record=record, kind=zero
    )
    state, output = step(world, state, state.action)
    assert np.asarray(output.truncated).all()
    assert float(jnp.nanmean(output.episode["success_flat"])) == 1.0
    assert np.isnan(output.episode["success_easy"]).all()
    assert int(state.curriculum.regions.opened) == 2
    assert set(np.asarray(state.region)) == {0, 1}  # the new episodes
