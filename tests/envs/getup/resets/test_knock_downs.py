from __future__ import annotations

import mujoco
import numpy as np
import pytest
from ground_samples import deepest_contact

from getup_jax.config import ConfigError
from getup_jax.envs.getup.resets import knock_downs, lying
from getup_jax.envs.getup.resets.knock_downs import knock_down
from getup_jax.envs.getup.resets.standing import stand
from getup_jax.physics.plane import Plane
from getup_jax.pose_prior.data import pose_conditions


def silent(text: str) -> None:
    pass


def neck_gap(character, field, qpos: np.ndarray) -> np.ndarray:
    """Height [N] (m) of the neck above the ground below it."""
    data, link = mujoco.MjData(character.model), character.link("neck") + 1
    gaps = []
    for row in qpos:
        data.qpos[:] = row
        mujoco.mj_kinematics(character.model, data)
        gaps.append(data.xpos[link, 2] - field.height(data.xpos[link, :2]))
    return np.array(gaps)


@pytest.fixture(scope="module")
def on_the_plane(character):
    return knock_down(character, Plane(), np.array([30]), None, np.random.default_rng(0), silent)


def test_what_was_pushed_lies_still_on_the_ground(on_the_plane, character):
    assert len(on_the_plane.region) == 30
    assert np.abs(on_the_plane.qvel).max() < 0.3
    gap = deepest_contact(character, on_the_plane.qpos)
    assert gap.min() > -0.02
    assert gap.max() < 0.01
    assert neck_gap(character, Plane().field(), on_the_plane.qpos).max() < 0.4


def test_it_falls_in_every_direction_and_in_many_poses(on_the_plane, character):
    front = np.degrees(pose_conditions(on_the_plane.qpos, character)[:, 2])
    assert (front > 130).any()  # on the face
    assert (front < 50).any()  # on the back
    moved = np.abs(on_the_plane.qpos[:, 7:] - character.neutral_qpos[7:]).sum(axis=1)
    assert moved.min() > 0.5
    assert np.ptp(moved) > 2.0  # of weak servos and of strong ones


def test_on_slopes_what_stands_there_is_pushed(site):
    standing = stand(site.character, site.ground, 6, 0, silent)
    rng = np.random.default_rng(0)
    starts = knock_down(site.character, site.ground, np.array([2, 0, 0, 3]), standing, rng, silent)
    np.testing.assert_array_equal(starts.region, [0, 0, 3, 3, 3])
    np.testing.assert_array_equal(site.ground.region(starts.qpos[:, :2]), starts.region)
    assert neck_gap(site.character, site.ground.field(), starts.qpos).max() < 0.4


def test_bodies_that_withstand_the_pushes_are_an_error(character, monkeypatch):
    monkeypatch.setattr(knock_downs, "_LYING_M", -1.0)  # the neck is never that low
    monkeypatch.setattr(lying, "_ROUNDS", 2)
    with pytest.raises(ConfigError, match=r"task\.limp_share: bodies that are pushed do not"):
        knock_down(character, Plane(), np.array([2]), None, np.random.default_rng(0), silent)
