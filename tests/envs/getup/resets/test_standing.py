from __future__ import annotations

import mujoco
import numpy as np
import pytest
from ground_samples import deepest_contact

from getup_jax.envs.getup.resets.standing import SIDES, soles_touch, stand


@pytest.fixture(scope="module")
def starts(site):
    return stand(site.character, site.ground, 45, 0, lambda text: None)


def foot_contacts(model: mujoco.MjModel, qpos: np.ndarray) -> dict[str, list[float]]:
    """Distances (m) of every foot's contacts with the ground, up to 1 cm above it."""
    floor, data = model.geom("floor").id, mujoco.MjData(model)
    model.geom_margin[floor] = 0.01
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    model.geom_margin[floor] = 0.0
    found: dict[str, list[float]] = {side: [] for side in SIDES}
    for contact in data.contact:
        for side in SIDES:
            if (
                floor in contact.geom
                and model.body(f"foot_{side}").id in (model.geom_bodyid[contact.geom])
            ):
                found[side].append(contact.dist)
    return found


def test_every_irregular_region_gets_as_many(starts, site):
    np.testing.assert_array_equal(np.bincount(starts.region), [0, 15, 15, 15])
    np.testing.assert_array_equal(site.ground.region(starts.qpos[:, :2]), starts.region)
    np.testing.assert_array_equal(starts.qvel, 0.0)


def test_both_feet_are_in_contact_within_a_centimetre(starts, site):
    assert soles_touch(site.character, site.ground.field(), starts.qpos).all()
    for row in starts.qpos:
        contacts = foot_contacts(site.character.model, row)
        assert all(len(distances) >= 2 for distances in contacts.values())
        assert all(abs(d) < 0.01 for distances in contacts.values() for d in distances)


def test_nothing_else_touches_the_ground_and_nothing_is_in_it(starts, site):
    assert deepest_contact(site.character, starts.qpos).min() > -0.01


def test_soles_are_turned_to_the_slope_and_the_trunk_is_upright(starts, site):
    model, field = site.character.model, site.ground.field()
    data = mujoco.MjData(model)
    sloped = starts.qpos[:, 1] % 16.0 < 8.0  # the lower half of a region has even slopes
    assert sloped.sum() > 10
    for row in starts.qpos[sloped]:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        for side in SIDES:
            foot = data.body(f"foot_{side}")
            up = foot.xmat.reshape(3, 3)[:, 2]
            # the sine of the angle between them: below one degree
            assert np.linalg.norm(np.cross(up, field.normal(foot.xpos[:2]))) < 0.017
        assert data.body("pelvis").xmat[8] == pytest.approx(1.0)


def test_other_joints_keep_the_neutral_pose(starts, site):
    character = site.character
    legs = [i for i, name in enumerate(character.joint_names) if name[:5] in ("thigh", "shin_")]
    feet = [i for i, name in enumerate(character.joint_names) if name.startswith("foot")]
    rest = np.setdiff1d(np.arange(character.num_joints), legs + feet)
    neutral = np.tile(character.neutral_qpos[7:][rest], (len(starts.qpos), 1))
    np.testing.assert_array_equal(starts.qpos[:, 7:][:, rest], neutral)
    joints = starts.qpos[:, 7:]
    assert (joints >= character.joint_lower - 1e-9).all()
    assert (joints <= character.joint_upper + 1e-9).all()


@pytest.mark.slow
def test_no_stance_of_a_thousand_floats_or_sinks(site):
    starts = stand(site.character, site.ground, 1000, 1, lambda text: None)
    gap = deepest_contact(site.character, starts.qpos)
    assert len(gap) >= 1000
    assert gap.min() > -0.01
    assert gap.max() < 0.01
