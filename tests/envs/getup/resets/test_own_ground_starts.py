"""Start states on a ground of one's own, from its file to the pool."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from ground_samples import deepest_contact
from scipy.ndimage import gaussian_filter
from tiny_task import changed, getups, neutral_prior

from getup_jax.config import TerrainConfig
from getup_jax.envs.getup.build import assemble
from getup_jax.envs.getup.episode import LYING, STANDING
from getup_jax.envs.getup.resets import lying_bodies, region_pool
from getup_jax.physics.character import load_character
from getup_jax.physics.terrain_map import make_terrain


@pytest.fixture(scope="module")
def terrain(tmp_path_factory):
    file = tmp_path_factory.mktemp("hills") / "hills.npy"
    hills = gaussian_filter(np.random.default_rng(1).normal(size=(33, 33)), 5)
    np.save(file, hills)
    return TerrainConfig(heights=str(file), height_m=1.5, region_size_m=16.0, drops=45)


def test_bodies_lie_and_stand_on_it_in_every_region(character, terrain, tmp_path, monkeypatch):
    for module in (region_pool, lying_bodies):
        monkeypatch.setattr(module, "cache_dir", lambda: tmp_path)
    config = changed(stand_start=0.3, pool_size=48)
    config = dataclasses.replace(config, terrain=terrain)
    task = assemble(config, character, getups(character), neutral_prior(character), print)
    ground, pool = make_terrain(terrain), task.world.pool
    on_ground = load_character(config.physics, ground)
    qpos, table = np.asarray(pool.physics.kinematics.qpos), np.asarray(pool.table)
    for region in range(4):
        for kind in (LYING, STANDING):
            starts = qpos[np.unique(table[kind, region])]
            np.testing.assert_array_equal(ground.region(starts[:, :2]), region)
            gap = deepest_contact(on_ground, starts)
            assert gap.min() > -0.02
            assert gap.max() < 0.01
    height = task.world.terrain.height(qpos[np.unique(table[:, 3]), :2])
    assert np.ptp(height) > 0.2  # on hills and in hollows
