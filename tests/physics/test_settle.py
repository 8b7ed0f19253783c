from __future__ import annotations

import mujoco
import numpy as np
from poses import lying

from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.settle import lift_to_ground, settle


def floor_gap(character: CharacterSpec, qpos: np.ndarray) -> float:
    """Deepest contact with the floor (m), inf without one."""
    model, data = character.model, mujoco.MjData(character.model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    floor = model.geom("floor").id
    return min((c.dist for c in data.contact if floor in c.geom), default=np.inf)


def test_the_lowest_point_is_at_the_gap(character):
    poses = lying(character, 4)
    poses[:, 2] = [0.05, 0.3, 1.0, 5.0]
    lifted = lift_to_ground(character, poses, -0.002)
    np.testing.assert_allclose([floor_gap(character, row) for row in lifted], -0.002, atol=1e-6)
    np.testing.assert_array_equal(np.delete(lifted, 2, axis=1), np.delete(poses, 2, axis=1))
    assert poses[3, 2] == 5.0  # the caller's poses stay
    above = lift_to_ground(character, poses, 0.01)
    assert all(np.isinf(floor_gap(character, row)) for row in above)
    np.testing.assert_allclose(above[:, 2] - lifted[:, 2], 0.012, atol=1e-6)


def test_dropped_poses_come_to_rest_in_their_pose(character):
    poses = lift_to_ground(character, lying(character, 4), 0.01)
    qpos, qvel = settle(character, poses, seconds=1.0)
    assert (qpos[:, 2] < poses[:, 2]).all()
    assert all(floor_gap(character, row) < 0 for row in qpos)
    assert np.abs(qvel[:, :3]).max() < 0.2
    # free of the floor, the servos hold the pose; on it, a limb gives way a little
    assert np.median(np.abs(qpos[:, 7:] - poses[:, 7:])) < 0.02


def test_no_time_changes_nothing(character):
    poses = lying(character, 2)
    qpos, qvel = settle(character, poses, seconds=0.0)
    np.testing.assert_array_equal(qpos, poses)
    np.testing.assert_array_equal(qvel, np.zeros((2, 55)))


def test_a_pose_that_the_simulation_cannot_hold_stays_as_it_was(character):
    poses = lying(character, 3)
    poses[1, 9] = np.nan
    qpos, qvel = settle(character, poses, seconds=0.1)
    np.testing.assert_array_equal(qpos[1], poses[1])
    np.testing.assert_array_equal(qvel[1], 0.0)
    good, _ = settle(character, poses[[0, 2]], seconds=0.1)
    np.testing.assert_array_equal(qpos[[0, 2]], good)
    assert not np.array_equal(good, poses[[0, 2]])
