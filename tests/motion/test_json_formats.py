from __future__ import annotations

import json

import numpy as np
import pytest

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.deepmimic import COLUMNS
from getup_jax.motion.io.readers import motion_files, read_motion
from getup_jax.motion.io.recording import forward

IDENTITY = [0.0, 0.0, 0.0, 1.0]


def deepmimic_row(dt=0.05, height=0.9, knee=0.0):
    row = [dt, 0.0, height, 0.0, *[1.0, 0, 0, 0] * 4, knee, *[1.0, 0, 0, 0] * 2, 0.0]
    row += [*[1.0, 0, 0, 0], 0.0, *[1.0, 0, 0, 0] * 2, 0.0]
    assert len(row) == COLUMNS
    return row


def write(tmp_path, content, name):
    file = tmp_path / name
    file.write_text(content if isinstance(content, str) else json.dumps(content))
    return file


def test_deepmimic_zero_pose_stands_facing_x(tmp_path):
    rows = {"Loop": "none", "Frames": [deepmimic_row(), deepmimic_row()]}
    motion = read_motion(write(tmp_path, rows, "a.txt"))
    place = dict(zip(motion.joint_names, forward(motion)[0][0], strict=True))
    assert motion.fps == pytest.approx(20)
    assert place["neck"][2] > place["chest"][2] > place["root"][2] == pytest.approx(0.9)
    assert place["left_hip"][1] > 0 > place["right_hip"][1]


def test_deepmimic_negative_knee_angles_bend_the_knee_back(tmp_path):
    rows = {"Loop": "none", "Frames": [deepmimic_row(knee=-1.0)]}
    motion = read_motion(write(tmp_path, rows, "a.txt"))
    place = dict(zip(motion.joint_names, forward(motion)[0][0], strict=True))
    assert place["right_ankle"][0] < place["right_knee"][0] - 0.2


def test_deepmimic_frames_of_unequal_duration_are_put_on_one_rate(tmp_path):
    heights = [(0.1, 0.0), (0.1, 0.1), (0.2, 0.2), (0.1, 0.4), (0.1, 0.5)]
    rows = {"Loop": "none", "Frames": [deepmimic_row(dt, height) for dt, height in heights]}
    motion = read_motion(write(tmp_path, rows, "a.txt"))
    np.testing.assert_allclose(motion.translations[:, 0, 2], [0, 0.1, 0.2, 0.3, 0.4, 0.5])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"Frames": []}, "at least one frame"),
        ({"Frames": [[1.0, 2.0]]}, "frame 0: expected 44 values, got 2"),
        ({"Frames": [deepmimic_row(), [*deepmimic_row()[:-1], None]]}, "frame 1, column 43"),
        ({"Frames": [deepmimic_row(0.0), deepmimic_row()]}, "frame 0: expected a duration above 0"),
        ('{"Frames": [[1.0,\n nan]]', "line 2: broken JSON"),
        ({"poses": []}, "expected DeepMimic's"),
        ({"Frames": [[*deepmimic_row()[:-1], 10**400]]}, "frame 0, column 43: expected a finite"),
        ({"Frames": [[*deepmimic_row()[:-1], 1e308]]}, "frame 0, column 43: expected a finite"),
        ({"Frames": [[*deepmimic_row()[:-1], True]]}, "frame 0, column 43: expected a finite"),
        ({"Frames": [deepmimic_row(1e-200), deepmimic_row()]}, "frame 0: expected a duration"),
        ({"Frames": [deepmimic_row(9e5), deepmimic_row()]}, "frame 0: expected a duration above 0"),
        (
            {"Frames": [[*deepmimic_row()[:4], 0, 0, 0, 0, *deepmimic_row()[8:]]]},
            "frame 0, joint root: expected a rotation, got a zero quaternion",
        ),
    ],
)
def test_deepmimic_errors(tmp_path, content, message):
    with pytest.raises(MotionError, match=message):
        read_motion(write(tmp_path, content, "a.txt"))


def test_composite_bodies_that_are_left_out_keep_the_identity(tmp_path):
    half = [0.0, 0.0, 1.0, 0.0]  # half a turn about z, as xyzw
    clip = {"fps": 30, "frames": [{"pelvis": [[1.0, 2.0, 0.9], half]}]}
    motion = read_motion(write(tmp_path, clip, "a.json"))
    place = dict(zip(motion.joint_names, forward(motion)[0][0], strict=True))
    np.testing.assert_allclose(place["pelvis"], [1, 2, 0.9])
    assert place["left_thigh"][1] < 2 < place["right_thigh"][1]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"fps": 0, "frames": [{}]}, "fps: expected a number above 0, got 0"),
        ({"fps": 30, "frames": []}, "expected a list of poses"),
        ({"fps": 30, "frames": [{"torso": IDENTITY}]}, "frame 0: expected .* with a pelvis"),
        ({"fps": 30, "frames": [{"pelvis": [[0, 0, 1], IDENTITY], "tail": IDENTITY}]}, "'tail'"),
        ({"fps": 30, "frames": [{"pelvis": [[0, 0, 1], [0, 0, 0, 0]]}]}, "zero quaternion"),
        ({"fps": 30, "frames": [{"pelvis": [[0, 0], IDENTITY]}]}, "pelvis: expected 3 finite"),
        ({"fps": 30, "frames": [{"pelvis": IDENTITY}]}, r"pelvis: expected \[\[x, y, z\]"),
        ({"fps": 30, "frames": [{"pelvis": [[0, 0, 10**400], IDENTITY]}]}, "expected 3 finite"),
        ({"fps": 30, "frames": [{"pelvis": [[0, 0, 1e300], IDENTITY]}]}, "expected 3 finite"),
        ({"fps": 1e300, "frames": [{"pelvis": [[0, 0, 1], IDENTITY]}]}, "fps: expected a number"),
    ],
)
def test_composite_errors(tmp_path, content, message):
    with pytest.raises(MotionError, match=message):
        read_motion(write(tmp_path, content, "a.json"))


def test_unknown_suffixes_and_missing_files(tmp_path):
    with pytest.raises(MotionError, match=r"unknown format '.fbx'; known are"):
        read_motion(write(tmp_path, "x", "a.fbx"))
    with pytest.raises(MotionError, match="no such file"):
        read_motion(tmp_path / "b.bvh")


def test_text_files_may_come_in_any_encoding(tmp_path):
    content = json.dumps({"Loop": "none", "Frames": [deepmimic_row(), deepmimic_row()]})
    expected = read_motion(write(tmp_path, content, "plain.txt"))
    for encoding in ("utf-8-sig", "utf-16", "utf-16-le"):
        file = tmp_path / f"{encoding}.txt"
        file.write_bytes(content.encode(encoding) + b"\0\0")
        np.testing.assert_array_equal(read_motion(file).rotations, expected.rotations)
        assert file in motion_files(tmp_path)


def test_a_folder_gives_its_motion_files_only(tmp_path):
    (tmp_path / "folder.bvh").mkdir()
    write(tmp_path, "some notes", "readme.txt")
    write(tmp_path, {"other": 1}, "settings.json")
    clip = write(tmp_path, {"fps": 30, "frames": []}, "clip.json")
    assert motion_files(tmp_path) == [clip]


def test_the_recordings_of_both_formats(mocap):
    for name in ("deepmimic/humanoid3d_walk.txt", "composite_motion/motions/gym/punch.json"):
        motion = read_motion(mocap / name)
        assert motion.fps == pytest.approx(30, rel=1e-3)
        assert forward(motion)[0][:, 0, 2].min() > 0.6
