from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from motion_samples import two_bones
from scipy.spatial.transform import Rotation

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io import recording

NONE = [1.0, 0, 0, 0]
QUARTER_X = Rotation.from_euler("x", 90, degrees=True).as_quat(scalar_first=True)


def test_a_child_turns_with_its_parent():
    position, rotation = recording.forward(two_bones([[QUARTER_X, NONE]]))
    np.testing.assert_allclose(position[0, 1], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(rotation[0, 1], rotation[0, 0])


def test_resampling_to_twice_the_rate_meets_the_old_frames_and_the_half_way():
    motion = two_bones([[NONE, NONE], [QUARTER_X, NONE]], fps=10)
    fine = recording.resampled(motion, 20)
    assert fine.num_frames == 3
    half = Rotation.from_quat(fine.rotations[1, 0], scalar_first=True)
    assert half.magnitude() == pytest.approx(np.pi / 4)
    np.testing.assert_allclose(
        recording.resampled(fine, 10).rotations, motion.rotations, atol=1e-12
    )


def test_turning_the_world_turns_the_positions():
    motion = two_bones([[QUARTER_X, NONE]])
    turn = Rotation.from_euler("z", 30, degrees=True)
    position = recording.forward(recording.turned(motion, turn))[0]
    np.testing.assert_allclose(position, turn.apply(recording.forward(motion)[0][0])[None])


def test_scaling_scales_every_length():
    motion = recording.scaled(two_bones([[NONE, NONE]]), 0.01)
    np.testing.assert_allclose(recording.rest_positions(motion)[1], [0, 0, 0.01])
    np.testing.assert_allclose(motion.ends[1], [0, 0, 0.005])


def test_a_t_pose_row_is_replaced_and_the_others_keep_their_place():
    motion = two_bones([[NONE, QUARTER_X], [QUARTER_X, NONE], [NONE, NONE]])
    without = recording.without_first(motion)
    np.testing.assert_array_equal(without.rotations[[0, 1, 2]], motion.rotations[[1, 1, 2]])


def test_nan_is_reported_with_its_frame_and_joint():
    motion = two_bones([[NONE, NONE], [NONE, NONE]])
    rotations = motion.rotations.copy()
    rotations[1, 1, 2] = np.nan
    bad = dataclasses.replace(motion, rotations=rotations)
    with pytest.raises(MotionError, match=r"two\.bvh: frame 1, joint b"):
        recording.check_finite(bad)
