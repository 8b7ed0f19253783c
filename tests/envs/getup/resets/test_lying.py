from __future__ import annotations

import mujoco
import numpy as np
import pytest

from getup_jax.config import ConfigError
from getup_jax.envs.getup.resets import lying
from getup_jax.envs.getup.resets.lying import (
    DAMPING,
    Starts,
    falling_model,
    is_on_ground,
    until_enough,
)
from getup_jax.envs.getup.resets.rag_doll import DROPS, evenly, fall
from getup_jax.physics.surface import lift, link_gaps


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
    monkeypatch.setattr(lying, "_STILL", 0.0)
    monkeypatch.setattr(lying, "_ROUNDS", 1)
    monkeypatch.setattr(lying, "_MOST_FALLS", 1)
    rng = np.random.default_rng(0)
    with pytest.raises(ConfigError, match=r"do not come to rest in the region 'easy'"):
        fall(site.character, site.ground, evenly(3), DROPS["limp"][0], rng, lambda text: None)


def test_weak_servos_have_a_share_of_the_torque(character):
    weak, off = falling_model(character, 0.05), falling_model(character, 0.0)
    np.testing.assert_allclose(weak.actuator_forcerange[:, 1], 0.05 * character.torque_limit)
    assert not weak.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ACTUATION
    assert off.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ACTUATION
    np.testing.assert_array_equal(weak.dof_damping[6:], DAMPING)
    assert character.model.actuator_forcerange[0, 1] == character.torque_limit[0]  # a copy


def test_what_is_missing_is_made_again_until_every_region_has_enough():
    asked = []

    def make(region: np.ndarray) -> Starts:
        """Every second one is fair; their numbers go on from round to round."""
        first = sum(map(len, asked))
        asked.append(region)
        number = first + np.arange(len(region))[::2, None]
        return Starts(number, number, region[::2])

    found = until_enough(np.array([2, 0, 4]), make, "nothing")
    np.testing.assert_array_equal(found.region, [0, 0, 2, 2, 2, 2])
    assert [np.bincount(region).tolist() for region in asked] == [[3, 0, 5], [0, 0, 3]]
    # of the regions 0 0 0 2 2 2 2 2 the fair ones are 0, 2, 4, 6; then 8 and 10
    np.testing.assert_array_equal(found.qpos[:, 0], [0, 2, 4, 6, 8, 10])
