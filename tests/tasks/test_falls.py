from __future__ import annotations

import mujoco
import numpy as np
import pytest
from ground_samples import deepest_contact, lowest_centre

from getup_jax.config import ConfigError
from getup_jax.nets.prior_data import pose_conditions
from getup_jax.physics.surface import lift, link_gaps
from getup_jax.tasks import falls
from getup_jax.tasks.falls import fall, is_on_ground


@pytest.fixture(scope="module")
def starts(site):
    return fall(site.character, site.ground, 45, 0, lambda text: None)


def test_every_irregular_region_gets_as_many(starts, site):
    np.testing.assert_array_equal(np.bincount(starts.region), [0, 15, 15, 15])
    np.testing.assert_array_equal(site.ground.region(starts.qpos[:, :2]), starts.region)


def test_the_rag_dolls_rest_on_the_ground_and_not_in_it(starts, site):
    gap = deepest_contact(site.character, starts.qpos)
    assert gap.min() > -0.02
    assert gap.max() < 0.01
    assert lowest_centre(site.character, site.ground.field(), starts.qpos).min() > 0.0
    assert np.abs(starts.qvel).max() < 0.3


def test_they_lie_in_all_ways(starts, site):
    angles = pose_conditions(starts.qpos, site.character)[:, 1:]
    front = np.degrees(angles[:, 1])
    assert (front > 130).any()  # prone
    assert (front < 50).any()  # supine
    assert np.ptp(np.degrees(angles[:, 0])) > 60  # and on their sides or across a slope


def test_they_are_lying(starts, site):
    data, field = mujoco.MjData(site.character.model), site.ground.field()
    neck = site.character.link("neck") + 1
    for row in starts.qpos:
        data.qpos[:] = row
        mujoco.mj_kinematics(site.character.model, data)
        assert data.xpos[neck, 2] - field.height(data.xpos[neck, :2]) < 0.5


def test_the_same_seed_gives_the_same_falls(site):
    one, two = (fall(site.character, site.ground, 3, 7, lambda text: None) for _ in range(2))
    np.testing.assert_array_equal(one.qpos, two.qpos)


def test_a_body_that_floats_or_sinks_is_not_on_the_ground(site):
    field = site.ground.field()
    pose = np.tile(site.character.neutral_qpos, (3, 1))
    pose[:, :2] = [9.0, 13.0]
    pose = lift(site.character, field, pose, 0.0)
    np.testing.assert_allclose(link_gaps(site.character, field, pose).min(axis=1), 0.0, atol=1e-4)
    pose[1, 2] += 0.03
    pose[2, 2] -= 0.03
    np.testing.assert_array_equal(is_on_ground(site.character, field, pose), [True, False, False])


def test_falls_that_never_rest_are_an_error(site, monkeypatch):
    monkeypatch.setattr(falls, "_STILL", 0.0)
    monkeypatch.setattr(falls, "_ROUNDS", 1)
    monkeypatch.setattr(falls, "_MOST_FALLS", 1)
    with pytest.raises(ConfigError, match=r"do not come to rest in the region 'easy'"):
        fall(site.character, site.ground, 3, 0, lambda text: None)


@pytest.mark.slow
def test_no_start_of_a_thousand_sinks_floats_or_is_inside_the_ground(site):
    starts = fall(site.character, site.ground, 1000, 1, lambda text: None)
    gap = deepest_contact(site.character, starts.qpos)
    assert len(gap) == 1000
    assert gap.min() > -0.02
    assert gap.max() < 0.01
    assert lowest_centre(site.character, site.ground.field(), starts.qpos).min() > 0.0
