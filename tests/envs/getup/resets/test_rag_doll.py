from __future__ import annotations

import mujoco
import numpy as np
import pytest
from ground_samples import deepest_contact, lowest_centre

from getup_jax.envs.getup.resets import rag_doll
from getup_jax.envs.getup.resets.lying import Starts
from getup_jax.envs.getup.resets.rag_doll import DROPS, evenly
from getup_jax.physics.plane import Plane
from getup_jax.pose_prior.data import pose_conditions


def fall(site, count: int, seed: int) -> Starts:
    """Limp bodies in the irregular regions."""
    rng = np.random.default_rng(seed)
    wanted = evenly(count)
    return rag_doll.fall(
        site.character, site.ground, wanted, DROPS["limp"][0], rng, lambda text: None
    )


def on_the_plane(character, count: int, drop: str) -> Starts:
    rng = np.random.default_rng(0)
    return rag_doll.fall(
        character, Plane(), np.array([count]), DROPS[drop][0], rng, lambda text: None
    )


@pytest.fixture(scope="module")
def starts(site):
    return fall(site, 45, 0)


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
    one, two = (fall(site, 3, 7) for _ in range(2))
    np.testing.assert_array_equal(one.qpos, two.qpos)


def test_limp_bodies_on_the_plane_lie_in_every_orientation(character):
    starts = on_the_plane(character, 60, "any")
    side, front = np.degrees(pose_conditions(starts.qpos, character)[:, 1:]).T
    assert (front > 150).any()
    assert (front < 30).any()
    assert ((front > 50) & (front < 130)).any()
    assert (side < 60).any()
    assert (side > 120).any()
    gap = deepest_contact(character, starts.qpos)
    assert gap.min() > -0.02
    assert gap.max() < 0.01
    assert np.abs(starts.qvel).max() < 0.3
    np.testing.assert_array_equal(starts.region, 0)


def test_the_papers_bodies_fall_on_face_and_back_and_hold_their_pose(character):
    starts = on_the_plane(character, 40, "paper")
    side, front = np.degrees(pose_conditions(starts.qpos, character)[:, 1:]).T
    assert np.abs(side - 90).max() < 10
    assert ((front < 10) | (front > 170)).all()
    assert 0.15 < (front > 170).mean() < 0.65  # 40 % of 40
    moved = np.abs(starts.qpos[:, 7:] - character.neutral_qpos[7:]).sum(axis=1)
    limp = np.abs(on_the_plane(character, 10, "limp").qpos[:, 7:] - character.neutral_qpos[7:])
    assert moved.max() < 3.0 < limp.sum(axis=1).min()


@pytest.mark.slow
def test_no_start_of_a_thousand_sinks_floats_or_is_inside_the_ground(site):
    starts = fall(site, 1000, 1)
    gap = deepest_contact(site.character, starts.qpos)
    assert len(gap) == 1000
    assert gap.min() > -0.02
    assert gap.max() < 0.01
    assert lowest_centre(site.character, site.ground.field(), starts.qpos).min() > 0.0
