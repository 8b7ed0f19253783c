"""The keyframe format, its errors, and what happens between keyframes."""

import mujoco
import numpy as np
import pytest

from getup_jax.motion.authoring.contact_ik import Planter, contacts_of, geom_bottoms
from getup_jax.motion.authoring.keyframes import (
    Keyframe,
    KeyframeMotion,
    clip_from_keyframes,
    read_keyframes,
)
from getup_jax.motion.clips import MotionError

GOOD = """
name: nod
strategy: test
keyframes:
  - time: 0
    position: [0.0, 0.0, 0.92]
    planted: [foot_l, foot_r]
    angles: {neck: [0, 0, 0], arm_l: [10, 20, 0]}
  - time: 0.5
    note: squatting a little
    position: [0.03, 0.0, 0.85]
    rotation: [0, 10, 0]
    planted: [foot_l, foot_r]
    angles: {neck: [20, 0, 0], thigh_l: [40, 0, 0], thigh_r: [40, 0, 0], shin_l: -60, shin_r: -60}
  - time: 1.0
    position: [0.0, 0.0, 0.918]
    rotation: [0, 0, 0]
    pose: neutral
"""


@pytest.fixture
def write(tmp_path):
    def _write(text, name="nod"):
        path = tmp_path / f"{name}.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return _write


def test_reads_angles_in_degrees_and_keeps_them(write, character):
    motion = read_keyframes(write(GOOD), character)
    first, second, last = motion.keyframes
    arm = 7 + character.joint("arm_l_abd")
    assert first.qpos[arm] == pytest.approx(np.radians(20))
    assert second.qpos[arm] == pytest.approx(np.radians(20))  # not named: kept
    assert second.qpos[7 + character.joint("neck_flex")] == pytest.approx(np.radians(20))
    np.testing.assert_array_equal(last.qpos[7:], character.neutral_qpos[7:])
    np.testing.assert_allclose(
        second.qpos[3:7], [np.cos(np.radians(5)), 0, np.sin(np.radians(5)), 0]
    )
    assert (motion.duration, second.note, first.planted) == (
        1.0,
        "squatting a little",
        ("foot_l", "foot_r"),
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("arm_l: [10, 20, 0]", "arn_l: [10, 20, 0]", r"keyframe 0 \(0 s\): angles: .*'arm_l'"),
        ("arm_l: [10, 20, 0]", "arm_l: [10, 20]", "angles: arm_l: expected 3 numbers"),
        ("shin_l: -60", "shin_l: 60", r"keyframe 1 \(0.5 s\).*shin_l_flex = 60.0 degrees: outside"),
        ("shin_l: -60", "shin_l: straight", "angles: shin_l: expected a number"),
        ("time: 0.5", "time: 0", "time: expected more than the 0 s before it"),
        ("- time: 0\n", "- time: 1\n", "the first keyframe is at 0, got 1"),
        ("note:", "notes:", "keyframe 1: unknown 'notes'; did you mean 'note'"),
        ("[foot_l, foot_r]", "[foot]", "planted: unknown 'foot'; did you mean 'foot_"),
        ("rotation: [0, 10, 0]", "rotation: [0, 10]", "rotation: expected 3 numbers"),
        ("pose: neutral", "pose: sitting", "pose: expected 'neutral'"),
        ("name: nod", "name: not", "name: expected 'nod'"),
        ("strategy", "stratagy", "unknown 'stratagy'; did you mean 'strategy'"),
        ("strategy: test", "mirror_of: me", "mirror_of: expected the name of another file"),
        ("- time: 0\n", "- tim: {\n", "not valid YAML"),
    ],
)
def test_errors_name_the_place_and_the_cure(write, character, old, new, message):
    with pytest.raises(MotionError, match=f"nod.yaml: .*{message}"):
        read_keyframes(write(GOOD.replace(old, new, 1)), character)


def test_missing_file_and_empty_motion(tmp_path, write, character):
    with pytest.raises(MotionError, match=r"none\.yaml: cannot be read"):
        read_keyframes(tmp_path / "none.yaml", character)
    with pytest.raises(MotionError, match="expected a list of at least 2"):
        read_keyframes(write("name: nod\nkeyframes: []\n"), character)


def test_mirror_image_swaps_sides_and_may_be_slower(write, character):
    original = read_keyframes(write(GOOD), character)
    text = "name: mirrored\nstrategy: test\nmirror_of: nod\nduration: 3\n"
    mirrored = read_keyframes(write(text, "mirrored"), character)
    assert mirrored.duration == 3.0
    assert set(mirrored.keyframes[0].planted) == {"foot_l", "foot_r"}
    for key, other in zip(original.keyframes, mirrored.keyframes, strict=True):
        np.testing.assert_allclose(character.mirror(other.qpos), key.qpos)
        assert other.time == pytest.approx(3 * key.time)


def test_clip_passes_through_the_keyframes_at_a_constant_rate(write, character):
    motion = read_keyframes(write(GOOD), character)
    clip = clip_from_keyframes(motion, character)
    assert (len(clip.qpos), clip.fps, clip.duration) == (31, 30.0, 1.0)
    for key in motion.keyframes:
        np.testing.assert_allclose(clip.qpos[round(30 * key.time), 7:], key.qpos[7:], atol=0.03)
    np.testing.assert_allclose(np.linalg.norm(clip.qpos[:, 3:7], axis=1), 1.0)


def test_planted_feet_stay_while_the_knees_bend(character):
    feet = ("foot_l", "foot_r")
    planter = Planter(character)
    low = character.neutral_qpos.copy()
    for joint, angle in (("thigh", 1.2), ("shin", -2.0), ("foot", 0.8)):
        low[[7 + character.joint(f"{joint}_{side}_flex") for side in "lr"]] = angle
    low[:3] += [-0.05, 0.0, -0.3]
    low = planter.solve(low, planter.poses(character.neutral_qpos, feet))
    start, end = Keyframe(0.0, character.neutral_qpos, feet), Keyframe(1.0, low, ())
    held = clip_from_keyframes(KeyframeMotion("down", "", (start, end)), character)
    start = Keyframe(0.0, character.neutral_qpos, ())
    loose = clip_from_keyframes(KeyframeMotion("down", "", (start, end)), character)
    held_path, loose_path = _foot_path(held, character), _foot_path(loose, character)
    assert np.abs(held_path - held_path[0]).max() < 0.003
    assert np.abs(loose_path - loose_path[0]).max() > 0.01


def test_every_frame_rests_on_the_floor(write, character):
    clip = clip_from_keyframes(read_keyframes(write(GOOD), character), character)
    data = mujoco.MjData(character.model)
    for qpos in clip.qpos:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(character.model, data)
        bottoms = geom_bottoms(character.model, data.geom_xpos, data.geom_xmat)
        assert bottoms.min() == pytest.approx(0.0, abs=1e-9)


def test_geom_bottoms_are_those_of_the_collision_engine(character):
    """Against MuJoCo's own distance to the floor plane, over turned poses."""
    data = mujoco.MjData(character.model)
    rng = np.random.default_rng(0)
    solid = np.flatnonzero((character.model.geom_contype != 0) & (character.model.geom_bodyid != 0))
    for _ in range(5):
        data.qpos[:] = character.neutral_qpos
        data.qpos[2] = 2.0
        data.qpos[3:7] = rng.standard_normal(4)
        mujoco.mj_kinematics(character.model, data)
        bottoms = geom_bottoms(character.model, data.geom_xpos, data.geom_xmat)
        for bottom, geom in zip(bottoms, solid, strict=True):
            distance = mujoco.mj_geomDistance(character.model, data, 0, geom, 5.0, None)
            assert bottom == pytest.approx(distance, abs=1e-6)


def test_planter_reaches_its_targets(character):
    planter = Planter(character)
    names = ("hand_l", "foot_r")
    poses = planter.poses(character.neutral_qpos, names)
    moved = {name: pose + np.r_[0.03, 0.02, 0.04, np.zeros(9)] for name, pose in poses.items()}
    solved = planter.poses(planter.solve(character.neutral_qpos, moved), names)
    for name in names:
        np.testing.assert_allclose(solved[name][:3], moved[name][:3], atol=2e-3)
    np.testing.assert_allclose(solved["foot_r"][3:], moved["foot_r"][3:], atol=0.02)
    assert not contacts_of(character)["foot_r"].turns


def _foot_path(clip, character):
    """Where the left sole is on the floor, [F, 2] (m)."""
    planter = Planter(character)
    return np.stack([planter.poses(qpos, ["foot_l"])["foot_l"][:2] for qpos in clip.qpos])
