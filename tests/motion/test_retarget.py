from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from motion_samples import PRONE, SUPINE, getup_clip, random_pose
from scipy.spatial.transform import Rotation

from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.getup.events import link_positions
from getup_jax.motion.io.bvh import BvhOptions, read_bvh
from getup_jax.motion.io.readers import read_motion
from getup_jax.motion.io.recording import cut, scaled
from getup_jax.motion.retarget.body import body_of, record
from getup_jax.motion.retarget.bone_lengths import guess_unit
from getup_jax.motion.retarget.joint_names import map_names
from getup_jax.motion.retarget.retarget import RetargetSettings, lift, retarget, starts_in_t_pose
from getup_jax.motion.retarget.solver import SolverSettings

# Our own character as the source needs no scaling, and no pull away from the exact answer.
EXACT = RetargetSettings(floor=0.0, solver=SolverSettings(previous=1e-9, rest=1e-9, tolerance=1e-6))


def smooth_poses(character, seed, count=12):
    """A slow way from the neutral pose to a random one, in the air."""
    rng = np.random.default_rng(seed)
    start, end = character.neutral_qpos.copy(), random_pose(character, rng)
    start[2] = 1.5
    turn = Rotation.from_quat(end[3:7], scalar_first=True).as_rotvec()
    share = np.linspace(0, 1, count)[:, None]
    poses = start + share * (end - start)
    poses[:, 3:7] = Rotation.from_rotvec(share * turn).as_quat(scalar_first=True)
    return poses


@pytest.mark.parametrize("seed", range(4))
def test_a_pose_of_our_own_character_is_recovered(character, seed):
    poses = smooth_poses(character, seed)
    source = record(Clip("own", 30.0, poses), character)
    clip, report = retarget(source, character, EXACT)
    same = link_positions(clip, character) - link_positions(Clip("own", 30.0, poses), character)
    assert np.linalg.norm(same, axis=-1).max() < 0.01
    np.testing.assert_allclose(clip.qpos[-1, :3], poses[-1, :3], atol=0.01)
    assert report.position_error_m < 0.005
    assert report.unknown_joints == ()


def test_a_skeleton_of_another_size_gives_the_same_pose_at_our_size(character):
    poses = smooth_poses(character, 5)
    small, large = (
        scaled(record(Clip("own", 30.0, poses), character), size) for size in (1.0, 120.0)
    )
    links = map_names(large.joint_names, large.parents)
    assert guess_unit(large, links) == 0.01
    ours, theirs = (retarget(source, character, EXACT)[0] for source in (small, large))
    np.testing.assert_allclose(theirs.qpos[:, 7:], ours.qpos[:, 7:], atol=1e-3)


def test_joints_stay_inside_their_limits_and_turn_no_faster_than_they_may(character):
    rng = np.random.default_rng(1)
    wild = np.stack([random_pose(character, rng, spread=1.0) for _ in range(10)])
    wild[:, 7:] *= 1.5
    clip, report = retarget(record(Clip("wild", 30.0, wild), character), character)
    hinges = clip.qpos[:, 7:]
    assert (hinges >= character.joint_lower - 1e-9).all()
    assert (hinges <= character.joint_upper + 1e-9).all()
    assert report.jump_rad < 0.5
    assert np.isfinite(clip.qpos).all()


def test_a_buried_body_is_lifted_out_of_the_floor(character):
    lying = getup_clip(character, PRONE, still_s=0.5, rise_s=1.0)
    sunk = lying.qpos.copy()
    sunk[:, 2] -= 0.1 * np.clip(np.linspace(2, -2, len(sunk)), 0, 1)
    clip, report = retarget(record(Clip("sunk", 30.0, sunk), character), character)
    assert report.penetration_m < 0.02
    assert np.abs(np.diff(clip.qpos[:, 2])).max() < 0.1


@pytest.mark.parametrize("seed", range(5))
def test_the_lift_is_enough_and_smooth(seed):
    settings = RetargetSettings()
    lowest = np.random.default_rng(seed).uniform(-0.2, 0.3, 200)
    lowest[40:160] = 0.1
    raised = lift(lowest, settings)
    assert (lowest + raised >= -settings.penetration_m - 1e-12).all()
    assert np.abs(np.diff(raised)).max() < 0.2
    assert raised[90] == 0


def test_standing_feet_are_put_on_the_floor(character):
    standing = getup_clip(character)
    raised = standing.qpos.copy()
    raised[:, 2] += 0.3  # a recording whose floor is at .3 m
    clip, _ = retarget(record(Clip("raised", 30.0, raised), character), character)
    assert clip.qpos[-1, 2] == pytest.approx(standing.qpos[-1, 2], abs=0.01)


def test_a_clip_that_never_stands_lies_on_the_floor(character):
    lying = getup_clip(character, SUPINE, still_s=0.5).qpos[:10]
    sunk = lying - np.eye(lying.shape[1])[2]  # a metre lower
    clip, report = retarget(record(Clip("crawl", 30.0, sunk), character), character)
    assert clip.qpos[0, 2] == pytest.approx(0.11, abs=0.02)
    assert report.position_error_m < 0.02


def test_the_rate_is_changed(character):
    clip = getup_clip(character, still_s=0.5, rise_s=0.5)
    fast = dataclasses.replace(record(clip, character), fps=60.0)
    assert len(retarget(fast, character)[0].qpos) == len(clip.qpos[::2])


def test_a_leading_t_pose_is_found_and_an_ordinary_start_is_not(character):
    clip = getup_clip(character)
    t_pose = character.neutral_qpos.copy()
    t_pose[7:] = 0
    for side in "lr":
        t_pose[7 + character.joint(f"arm_{side}_abd")] = np.pi / 2
    t_pose[3:7] = PRONE.as_quat(scalar_first=True)
    with_t = record(Clip("t", 30.0, np.concatenate([t_pose[None], clip.qpos])), character)
    links = map_names(with_t.joint_names, with_t.parents)
    assert starts_in_t_pose(with_t, links)
    assert not starts_in_t_pose(record(clip, character), links)
    result, report = retarget(with_t, character)
    assert "first row is a T-pose: dropped" in report.warnings[0]
    np.testing.assert_allclose(result.qpos[0], result.qpos[1], atol=0.05)


def test_links_that_are_far_from_the_recording_are_named(character):
    clip = getup_clip(character, still_s=0.2, rise_s=0.5)
    good = record(clip, character)
    assert retarget(good, character)[1].warnings == ()
    swapped = {"hand_l": "hand_r", "hand_r": "hand_l", "forearm_l": "forearm_r"}
    swapped |= {"forearm_r": "forearm_l", "shin_l": "shin_r", "shin_r": "shin_l"}
    _, report = retarget(good, character, RetargetSettings(names=swapped))
    (warning,) = report.warnings
    assert re.match(
        r"mean error \d+\.\d cm, at most 5 cm are usual: .* at \w+_[lr] \d+ cm, ", warning
    )
    assert "--names" in warning
    assert len(re.findall(r"_[lr] \d+ cm", warning)) <= 6


def test_a_motion_of_a_day_is_one_line(character):
    slow = dataclasses.replace(record(getup_clip(character), character), fps=1e-3)
    with pytest.raises(
        MotionError, match=r"rise: 120 frames at 0\.001 a second are 3,600,000 at 30"
    ):
        retarget(slow, character)


def test_missing_joints_are_an_error(character):
    source = record(getup_clip(character), character)
    nameless = dataclasses.replace(
        source, joint_names=tuple(f"j{i}" for i in range(len(source.joint_names)))
    )
    with pytest.raises(MotionError, match="no joint found for pelvis"):
        retarget(nameless, character)
    by_map = dict(zip(nameless.joint_names, source.joint_names, strict=True))
    _, report = retarget(nameless, character, RetargetSettings(names=by_map))
    assert report.position_error_m < 0.02


def test_the_body_knows_every_link_of_our_character(character):
    body = body_of(character)
    assert set(body.links) == set(character.link_names)
    for frame in body.frames.values():
        np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)


def test_lafan1_lying_and_rising(mocap, character):
    file = mocap / "lafan1" / "fallAndGetUp2_subject2.bvh"
    part = cut(read_bvh(file, BvhOptions(metres=0.01)), 300, 560)
    clip, report = retarget(part, character)
    assert report.frames == 260
    assert report.position_error_m < 0.05
    assert report.penetration_m < 0.02
    assert report.jump_rad < 0.5
    assert clip.qpos[:60, 2].max() < 0.25  # lying
    assert clip.qpos[-20:, 2].min() > 0.75  # standing


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("deepmimic/humanoid3d_getup_faceup.txt", 0.02),
        ("composite_motion/motions/gym/punch.json", 0.02),
        ("bandai_namco/dataset-1_walk_normal_002.bvh", 0.02),
        ("cmu/11_01.amc", 0.03),
    ],
)
def test_every_format_lands_on_the_character(mocap, character, name, error):
    clip, report = retarget(read_motion(mocap / name), character)
    assert report.position_error_m < error
    assert report.penetration_m < 0.02
    assert clip.qpos[-1, 2] > 0.75
