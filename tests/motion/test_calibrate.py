from __future__ import annotations

import numpy as np
import pytest
from bvh_samples import BASE, along_x, human_bvh, write

from getup_jax.motion.clips import MotionError
from getup_jax.motion.getup.events import link_positions
from getup_jax.motion.io.readers import read_motion
from getup_jax.motion.retarget.calibrate import anatomical_frames
from getup_jax.motion.retarget.identify import identify
from getup_jax.motion.retarget.retarget import RetargetSettings, retarget

COLLARS = {"LeftShoulder": (0, 10, 0), "RightShoulder": (0, 10, 0)}
COLLARS |= {"LeftArm": (17, 0, 0), "RightArm": (-17, 0, 0)}
NO_NECK = {"Neck": (0, 0, 0)}
NO_SPINE = {"Spine": (0, 0, 0), "Spine1": (0, 34, 0), "Spine2": (0, 0, 0)}


def human(tmp_path, offsets=None):
    return read_motion(write(tmp_path, human_bvh(offsets)))


@pytest.fixture(scope="module")
def expected(tmp_path_factory, character):
    """Link positions [F, L, 3] of the plain file's clip."""
    clip, _ = retarget(human(tmp_path_factory.mktemp("plain")), character)
    return link_positions(clip, character)


@pytest.mark.parametrize("offsets", [{}, COLLARS, COLLARS | NO_SPINE])
@pytest.mark.parametrize("form", [lambda recording: recording, along_x])
def test_the_same_motion_of_other_skeletons(tmp_path, character, expected, offsets, form):
    """Collars may start in the middle of the chest, and vertebrae in one place."""
    clip, report = retarget(form(human(tmp_path, offsets)), character)
    error = np.linalg.norm(link_positions(clip, character) - expected, axis=-1)
    assert error.mean() < 0.01
    assert error.max() < 0.03
    assert report.warnings == ()


@pytest.mark.parametrize("left_out", ["Spine", "Spine2", "Neck", "Head", "Toe", "Hand", "Shoulder"])
@pytest.mark.parametrize("form", [lambda recording: recording, along_x])
def test_skeletons_without_some_joints(tmp_path, character, expected, left_out, form):
    recording = form(human(tmp_path))
    names = {name: None for name in recording.joint_names if name.endswith(left_out)}
    clip, _ = retarget(recording, character, RetargetSettings(names=names))
    error = np.linalg.norm(link_positions(clip, character) - expected, axis=-1)
    assert np.median(error.mean(axis=0)) < 0.02


def test_a_skeleton_whose_trunk_is_of_no_named_joint(tmp_path, character):
    recording = along_x(human(tmp_path))
    trunk = ("Spine", "Spine1", "Spine2", "Neck", "Head")
    settings = RetargetSettings(names=dict.fromkeys(trunk))
    clip, report = retarget(recording, character, settings)
    assert np.isfinite(clip.qpos).all()
    assert report.position_error_m < 0.03


def test_frames_are_rotations(tmp_path):
    for offsets in ({}, COLLARS, NO_NECK, COLLARS | NO_NECK):
        recording, links = identify(along_x(human(tmp_path, offsets)))
        for frame in anatomical_frames(recording, links).values():
            np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-9)
            assert np.linalg.det(frame) == pytest.approx(1)


def test_a_joint_whose_axes_nothing_says_is_named(tmp_path):
    one_place = dict.fromkeys(("Neck", "Head", "LeftShoulder", "RightShoulder"), (0.0, 0.0, 0.0))
    arms = dict.fromkeys(("LeftArm", "RightArm", "LeftForeArm", "RightForeArm"), (0.0, 0.0, 0.0))
    recording, links = identify(along_x(human(tmp_path, one_place | arms)))
    with pytest.raises(MotionError, match=r"take: joint Spine2 \(spine_upper\): neither its bone"):
        anatomical_frames(recording, links)


def test_base_is_what_it_says(tmp_path, character):
    clip, report = retarget(read_motion(write(tmp_path, BASE)), character)
    assert report.position_error_m < 0.02
    assert clip.qpos[0, 2] < 0.25 < 0.75 < clip.qpos[-1, 2]
