from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from bvh_samples import BASE, along_x, write
from motion_samples import two_bones
from scipy.spatial.transform import Rotation

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.bvh import Y_UP, BvhOptions, read_bvh
from getup_jax.motion.io.bvh_writer import write_bvh
from getup_jax.motion.io.readers import read_motion
from getup_jax.motion.io.recording import forward, turned
from getup_jax.motion.retarget.up_axis import vertical_axis


@pytest.fixture
def human(tmp_path):
    """In our axes, Z up."""
    return read_motion(write(tmp_path, BASE))


def still(recording, frame):
    """The recording that stays as in one of its frames."""
    return dataclasses.replace(
        recording,
        translations=recording.translations[[frame] * 5],
        rotations=recording.rotations[[frame] * 5],
    )


def test_a_zero_pose_that_stands_says_it(human):
    assert vertical_axis(human) == "z"
    assert vertical_axis(turned(human, Y_UP.inv())) == "y"
    assert vertical_axis(still(human, 0)) == "z"  # though the motion lies along y


def test_a_motion_that_stands_on_a_floor_says_it_where_the_zero_pose_does_not(human):
    assert vertical_axis(along_x(human)) == "z"
    assert vertical_axis(turned(along_x(human), Y_UP.inv())) == "y"


@pytest.mark.parametrize("frame", [0, -1])
def test_a_still_body_whose_zero_pose_does_not_stand_says_nothing(human, frame):
    """It may stand along one axis as well as lie along the other."""
    assert vertical_axis(still(along_x(human), frame)) is None


@pytest.mark.parametrize("form", [lambda recording: recording, along_x])
@pytest.mark.parametrize(
    ("axis", "degrees", "expected"), [("y", 90, "x"), ("x", 180, "-z"), ("x", -90, "y")]
)
def test_other_axes_are_seen_too(human, form, axis, degrees, expected):
    turn = Rotation.from_euler(axis, degrees, degrees=True)
    assert vertical_axis(turned(form(human), turn)) == expected


def test_a_file_along_another_axis_is_refused_unless_asked_for(human, tmp_path):
    turn = Y_UP * Rotation.from_euler("y", 90, degrees=True)
    write_bvh(turned(human, turn), tmp_path / "x.bvh")
    with pytest.raises(MotionError, match=r"^x: the body stands along x, expected y or z; .* --up"):
        read_bvh(tmp_path / "x.bvh")
    assert read_bvh(tmp_path / "x.bvh", BvhOptions(up="y")).num_frames == human.num_frames


def test_a_zero_pose_along_another_axis_is_no_matter_where_the_motion_turns_it_up(human):
    """As of a root that turns X-up bones: what counts is how the body stands."""
    turn = Rotation.from_euler("y", 90, degrees=True)
    lying = turned(still(human, -1), turn)
    assert vertical_axis(lying) == "x"
    root = turn.inv() * Rotation.from_quat(lying.rotations[:, 0], scalar_first=True)
    rotations = lying.rotations.copy()
    rotations[:, 0] = root.as_quat(scalar_first=True)
    assert vertical_axis(dataclasses.replace(lying, rotations=rotations)) is None


def test_a_skeleton_that_is_no_body_says_nothing():
    assert vertical_axis(two_bones([[[1.0, 0, 0, 0], [1.0, 0, 0, 0]]])) is None


def test_files_are_read_along_their_own_axis_unless_another_is_asked_for(human, tmp_path):
    write_bvh(turned(human, Y_UP), tmp_path / "z.bvh")
    expected = forward(human)[0]
    for up in ("auto", "z"):
        found = forward(read_bvh(tmp_path / "z.bvh", BvhOptions(metres=0.01, up=up)))[0]
        np.testing.assert_allclose(found, expected, atol=1e-5)
    other = forward(read_bvh(tmp_path / "z.bvh", BvhOptions(metres=0.01, up="y")))[0]
    np.testing.assert_allclose(other, expected @ Y_UP.as_matrix().T, atol=1e-5)
