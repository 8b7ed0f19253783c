from __future__ import annotations

import numpy as np
import pytest
from motion_samples import TINY_BVH, random_pose

from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.io.bvh import BvhOptions, read_bvh
from getup_jax.motion.io.bvh_writer import write_bvh
from getup_jax.motion.io.recording import forward
from getup_jax.motion.retarget.body import record

Z_UP = BvhOptions(up="z")


def write(tmp_path, text, name="tiny.bvh"):
    file = tmp_path / name
    file.write_text(text)
    return file


def test_a_tiny_file(tmp_path):
    motion = read_bvh(write(tmp_path, TINY_BVH), Z_UP)
    assert motion.fps == pytest.approx(20)
    assert motion.joint_names == ("Hips", "Spine")
    np.testing.assert_allclose(motion.ends[1], [0, 5, 0])
    position, _ = forward(motion)
    np.testing.assert_allclose(position[0], [[1, 2, 3], [1, 12, 3]], atol=1e-12)
    # a quarter turn of the root about x carries the child from +y to +z
    np.testing.assert_allclose(position[1], [[1, 2, 4], [1, 2, 14]], atol=1e-12)


def test_y_up_files_become_z_up(tmp_path):
    position, _ = forward(read_bvh(write(tmp_path, TINY_BVH)))
    np.testing.assert_allclose(position[0, 1] - position[0, 0], [0, 0, 10], atol=1e-12)


@pytest.mark.parametrize("order", ["ZYX", "XYZ", "YXZ", "ZXY"])
def test_channels_apply_in_the_order_in_which_they_are_listed(tmp_path, order):
    names = " ".join(f"{axis}rotation" for axis in order)
    text = TINY_BVH.replace("Zrotation Xrotation Yrotation", names)
    text = text.replace("90.0 0.0 0.0\n", "30.0 40.0 50.0\n", 1)
    motion = read_bvh(write(tmp_path, text), Z_UP)
    expected = np.eye(3)
    for axis, degrees in zip(order, (30, 40, 50), strict=True):
        a, i = np.radians(degrees), "XYZ".index(axis)
        turn = np.eye(3)
        j, k = (i + 1) % 3, (i + 2) % 3
        turn[j, j] = turn[k, k] = np.cos(a)
        turn[k, j], turn[j, k] = np.sin(a), -np.sin(a)
        expected = expected @ turn
    np.testing.assert_allclose(forward(motion)[1][0, 1], expected, atol=1e-12)


def test_position_channels_of_an_inner_joint_replace_its_offset(tmp_path):
    text = TINY_BVH.replace(
        "CHANNELS 3 Zrotation Xrotation Yrotation",
        "CHANNELS 6 Zposition Yposition Xposition Zrotation Xrotation Yrotation",
    )
    text = text.replace("90.0 0.0 0.0\n", "7.0 8.0 9.0 0 0 0\n", 1)
    text = text.replace("90.0 0.0 0.0 0.0\n", "90.0 7.0 8.0 9.0 0 0 0\n", 1)
    motion = read_bvh(write(tmp_path, text), Z_UP)
    np.testing.assert_allclose(motion.translations[0, 1], [9, 8, 7])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("Frames: 2", "Frames: 4", r"header says 4 frames, file has 2 rows.*--allow-short"),
        ("Frames: 2", "Frames: 1", r"header says 1 frames, file has 2 rows.*--allow-short"),
        ("0.05", "0", r"line 18: expected a frame time above 0 s, got 0"),
        ("0.05", "nan", r"line 18: Frame Time: expected a finite number"),
        ("3.0 0.0 0.0 0.0 90.0", "3.0 0.0 0.0 0.0 nan", r"line 19, joint Spine Zrotation.*'nan'"),
        ("1.0 2.0 4.0", "1.0 two 4.0", r"line 20, joint Hips Yposition.*'two'"),
        ("1.0 2.0 4.0", "2.0 4.0", r"line 20: expected 9 values, one a channel, got 8"),
        ("Yrotation Xrotation", "Yrotatoin Xrotation", r"line 5: joint Hips.*did you mean Yrot"),
        ("CHANNELS 3", "CHANNELS 4", r"line 9: joint Spine: CHANNELS says '4', lists 3"),
        ("HIERARCHY", "HIRARCHY", r"line 1: expected HIERARCHY.*not a BVH file"),
        ("MOTION", "", r"expected a MOTION section|expected ROOT"),
        ("\t\t}\n\t}\n}", "\t\t}\n\t}", r"1 braces are still open"),
    ],
)
def test_errors_name_the_place(tmp_path, old, new, message):
    assert old in TINY_BVH
    with pytest.raises(MotionError, match=message):
        read_bvh(write(tmp_path, TINY_BVH.replace(old, new, 1)))


def test_a_short_file_is_taken_on_request_with_a_warning(tmp_path):
    file = write(tmp_path, TINY_BVH.replace("Frames: 2", "Frames: 5"))
    motion = read_bvh(file, BvhOptions(allow_short=True))
    assert motion.num_frames == 2
    assert "header says 5 frames, file has 2 rows" in motion.warnings[0]


def test_one_missing_row_is_a_warning(tmp_path):
    motion = read_bvh(write(tmp_path, TINY_BVH.replace("Frames: 2", "Frames: 3")))
    assert motion.num_frames == 2
    assert "header says 3 frames, file has 2 rows; 2 frames are used" in motion.warnings


def test_a_file_without_its_only_row_is_an_error(tmp_path):
    first, _ = TINY_BVH.replace("Frames: 2", "Frames: 1").split("1.0 2.0 3.0")
    with pytest.raises(MotionError, match="header says 1 frames, file has 0 rows; fix the header"):
        read_bvh(write(tmp_path, first), BvhOptions(allow_short=True))


@pytest.mark.parametrize("content", [b"\xff\xfe\x00binary", b""])
def test_a_file_that_is_no_text_or_empty(tmp_path, content):
    file = tmp_path / "x.bvh"
    file.write_bytes(content)
    with pytest.raises(MotionError, match=r"x\.bvh"):
        read_bvh(file)


def test_what_is_written_is_read_back(tmp_path, character):
    rng = np.random.default_rng(0)
    poses = np.stack([random_pose(character, rng) for _ in range(4)])
    before = record(Clip("poses", 30.0, poses), character)
    write_bvh(before, tmp_path / "poses.bvh")
    after = read_bvh(tmp_path / "poses.bvh", BvhOptions(metres=0.01))
    assert after.joint_names == before.joint_names
    assert after.fps == pytest.approx(30, rel=1e-5)
    for old, new in zip(forward(before), forward(after), strict=True):
        np.testing.assert_allclose(new, old, atol=2e-6)


def test_lafan1_header_defect_names_both_counts(mocap):
    motion = read_bvh(mocap / "lafan1" / "fallAndGetUp1_subject1.bvh")
    assert motion.num_frames == 5046
    assert "header says 5047 frames, file has 5046 rows" in motion.warnings[0]


@pytest.mark.parametrize(
    ("name", "joints", "fps"),
    [
        ("lafan1_locomotion/walk.bvh", 22, 30),
        ("bandai_namco/dataset-1_walk_normal_002.bvh", 22, 30),
        ("cmu/01_01.bvh", 31, 120),
    ],
)
def test_known_dialects(mocap, name, joints, fps):
    motion = read_bvh(mocap / name)
    assert motion.fps == pytest.approx(fps, rel=1e-3)
    assert len(motion.joint_names) in (joints, joints + 1, 38)
    head = motion.joint("Head")
    height = forward(motion)[0][1:, head, 2]
    assert (height > 0).all()
