from __future__ import annotations

import numpy as np
import pytest
from ground_samples import deepest_contact, make_site
from scipy.spatial.transform import Rotation
from tiny_task import CONFIG

from getup_jax.envs.getup.resets.terrain_projection import project_to_ground, to_normal

UP = np.array([[0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def site():
    return make_site(CONFIG.physics)


def placed(site, height: float, count: int = 20):
    """Neutral poses at a height, moving along x, and what becomes of them on the hard region."""
    rng = np.random.default_rng(0)
    qpos = np.tile(site.character.neutral_qpos, (count, 1))
    qpos[:, 2] = height
    qvel = np.zeros((count, site.character.model.nv))
    qvel[:, 0] = 1.0
    xy = site.ground.draw_spawn(3, count, rng)
    field, yaw = site.ground.field(), rng.uniform(-np.pi, np.pi, count)
    return (xy, yaw, field.normal(xy)), project_to_ground(
        site.character, field, qpos, qvel, xy, yaw
    )


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_a_share_of_the_turn_to_a_normal(share):
    normal = np.array([[np.sin(0.4), 0.0, np.cos(0.4)], [0.0, 0.0, 1.0]])
    up = to_normal(normal, share).apply(np.repeat(UP, 2, axis=0))
    np.testing.assert_allclose(up[0], [np.sin(0.4 * share), 0, np.cos(0.4 * share)], atol=1e-12)
    np.testing.assert_allclose(up[1], UP[0], atol=1e-12)


def test_states_touch_the_ground_where_they_should_be(site):
    (xy, _, _), (qpos, _) = placed(site, site.character.neutral_qpos[2])
    np.testing.assert_allclose(qpos[:, :2], xy)
    gap = deepest_contact(site.character, qpos)
    assert gap.min() > -0.02
    assert gap.max() < 0.01


def test_who_stands_stays_upright_and_turns_by_the_yaw(site):
    (_, yaw, _), (qpos, qvel) = placed(site, site.character.neutral_qpos[2])
    turn = Rotation.from_quat(qpos[:, 3:7], scalar_first=True)
    np.testing.assert_allclose(turn.apply(np.repeat(UP, len(yaw), 0)), np.repeat(UP, len(yaw), 0))
    along = np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], axis=1)
    np.testing.assert_allclose(qvel[:, :3], along, atol=1e-9)


def test_who_lies_turns_with_the_slope(site):
    (_, _, normal), (qpos, qvel) = placed(site, 0.0)
    turn = Rotation.from_quat(qpos[:, 3:7], scalar_first=True)
    np.testing.assert_allclose(turn.apply(np.repeat(UP, len(normal), 0)), normal, atol=1e-6)
    np.testing.assert_allclose((qvel[:, :3] * normal).sum(axis=1), 0.0, atol=1e-6)
    assert np.degrees(np.arccos(normal[:, 2])).max() > 20
