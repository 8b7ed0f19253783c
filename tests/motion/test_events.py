from __future__ import annotations

import csv

import numpy as np
import pytest
from motion_samples import PRONE, SUPINE, getup_clip

from getup_jax.motion.clips import GetUp, MotionError
from getup_jax.motion.getup.curves import NUM_POINTS
from getup_jax.motion.getup.events import (
    EventSettings,
    Heights,
    find_events,
    heights_of,
    link_positions,
    orientation,
)
from getup_jax.motion.getup.getups import clip_features, cut_getup, find_getups, flat_time
from getup_jax.motion.getup.strategies import OTHER, STRATEGIES
from getup_jax.motion.io.readers import ReadOptions
from getup_jax.motion.retarget.cache import Job, retarget_files
from getup_jax.motion.retarget.retarget import RetargetSettings


def ramp(*parts):
    """Heights that go from 0 (lying) to 1 (standing): (value, frames) one after the other."""
    values = np.concatenate([np.full(frames, value, float) for value, frames in parts])
    return Heights(head=values, pelvis=values, front_up=np.ones(len(values)))


def frames(heights, **settings):
    events = find_events(heights, 30.0, EventSettings(**settings))
    return [(e.lie_start, e.last_flat, e.last_lying, e.stand) for e in events]


def test_one_getup():
    assert frames(ramp((1, 10), (0.1, 20), (0.25, 5), (0.6, 15), (1, 10))) == [(10, 29, 34, 50)]


def test_a_short_break_does_not_end_the_lying_and_a_long_one_does():
    assert frames(ramp((0.1, 20), (0.5, 30), (0.1, 20), (1, 10)), gap_s=1.5) == [(0, 69, 69, 70)]
    assert frames(ramp((0.1, 20), (0.5, 60), (0.1, 20), (1, 10)), gap_s=1.5) == [(80, 99, 99, 100)]


def test_standing_between_two_lying_phases_makes_two_getups():
    both = ramp((0.1, 20), (1, 10), (0.1, 20), (1, 10))
    assert [stand for *_, stand in frames(both)] == [20, 50]


def test_no_getup_without_lying_or_without_standing():
    assert frames(ramp((1, 50))) == []
    assert frames(ramp((1, 20), (0.1, 50))) == []
    assert frames(ramp((0.1, 20), (0.6, 600), (1, 10))) == []  # too slow to be one get-up


@pytest.mark.parametrize(
    ("front_up", "name"), [(0.9, "supine"), (-0.9, "prone"), (0.2, "side"), (-0.4, "side")]
)
def test_orientations(front_up, name):
    assert orientation(front_up) == name


@pytest.mark.parametrize(("lying", "name"), [(SUPINE, "supine"), (PRONE, "prone")])
def test_a_synthetic_clip(character, lying, name):
    clip = getup_clip(character, lying)
    (event,), (getup,) = find_getups(clip, character)
    assert event.lie_start == 0
    assert event.orientation == name
    assert abs(event.last_flat - 30) <= 15
    assert abs(event.stand - 70) <= 10
    assert getup.clip is not None
    assert getup.duration == pytest.approx((len(getup.clip.qpos) - 1) / 30)
    assert getup.points[-1, 0] > 1.3
    assert getup.points[0, 0] < 0.3


@pytest.mark.parametrize(
    ("lying", "side", "front"), [(SUPINE, np.pi / 2, 0.0), (PRONE, np.pi / 2, np.pi)]
)
def test_features_of_known_poses(character, lying, side, front):
    clip = getup_clip(character, lying)
    values = clip_features(link_positions(clip, character), character)
    np.testing.assert_allclose(values[0, 1:], [side, front], atol=1e-3)
    np.testing.assert_allclose(values[-1, 1:], [np.pi / 2, np.pi / 2], atol=1e-3)
    neck = link_positions(clip, character)[:, character.link("neck"), 2]
    np.testing.assert_allclose(values[:, 0], neck, atol=1e-6)


def test_mirrored_twice_is_the_same_and_once_swaps_the_sides(character):
    clip = getup_clip(character)
    clip.qpos[:, 7:] += np.linspace(0, 0.1, character.num_joints)
    once = character.mirror(clip.qpos)
    np.testing.assert_array_equal(character.mirror(once), clip.qpos)
    position = link_positions(clip, character)
    clip.qpos[:] = once
    mirrored = link_positions(clip, character)
    left, right = character.links(("hand_l", "hand_r"))
    np.testing.assert_allclose(mirrored[:, left], position[:, right] * [1, -1, 1], atol=1e-9)


def test_heights_are_shares_of_the_neutral_pose(character):
    clip = getup_clip(character)
    heights = heights_of(link_positions(clip, character), character)
    assert heights.head[-1] == pytest.approx(1)
    assert heights.pelvis[-1] == pytest.approx(1)
    assert heights.front_up[0] == pytest.approx(1, abs=1e-6)


def test_a_cut_keeps_exactly_its_frames(character):
    clip = getup_clip(character)
    getup = cut_getup(clip, character, 20, 95)
    assert getup.name == "rise:20-95"
    assert getup.duration == pytest.approx(75 / 30)
    np.testing.assert_array_equal(getup.clip.qpos, clip.qpos[20:96])
    values = clip_features(link_positions(getup.clip, character), character)
    np.testing.assert_allclose(getup.points[[0, -1]], values[[0, -1]], atol=1e-9)
    assert (getup.fit_error < 0.1).all()


@pytest.mark.parametrize(("start", "stand"), [(-1, 50), (50, 40), (0, 500), (10, 12)])
def test_a_cut_outside_the_clip(character, start, stand):
    with pytest.raises(MotionError, match=f"rise:{start}-{stand}: expected first and last"):
        cut_getup(getup_clip(character), character, start, stand)


def test_the_time_that_a_curve_lies_flat():
    points = np.stack([np.linspace(0.0, 0.32, NUM_POINTS), *np.zeros((2, NUM_POINTS))], axis=1)
    assert flat_time(GetUp("half of it", 3.0, points)) == pytest.approx(1.5, abs=0.01)
    assert flat_time(GetUp("none of it", 3.0, points + 0.2)) == 0.0


def test_a_board_that_stands_up_follows_no_human_strategy(character):
    assert find_getups(getup_clip(character), character)[1][0].strategy == OTHER


def test_listed_lafan1_events(mocap, character, tmp_path):
    """Four listed get-ups of one take, from a part of the file that holds them."""
    name, start, stop = "fallAndGetUp2_subject2.bvh", 3300, 4100
    lines = (mocap / "lafan1" / name).read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    head = [f"Frames: {stop - start}" if "Frames:" in x else x for x in lines[:first]]
    part = tmp_path / name
    part.write_text("\n".join(head + lines[first + start : first + stop]))
    job = Job(part, character, ReadOptions(), RetargetSettings())
    ((clip, report),) = retarget_files([job], 1)
    assert report.position_error_m < 0.05
    events, getups = find_getups(clip, character)
    with (mocap / "lafan1" / "getup_events.csv").open() as stream:
        rows = [row for row in csv.DictReader(stream) if row["file"] == name]
    listed = [row for row in rows if start < int(row["lie_start"]) and int(row["stand"]) < stop]
    assert len(events) == len(listed) == 3
    for event, getup, row in zip(events, getups, listed, strict=True):
        for found, column in ((event.lie_start, "lie_start"), (event.last_flat, "last_flat")):
            assert abs(start + found - int(row[column])) <= 15
        assert abs(start + event.stand - int(row["stand"])) <= 30
        assert event.orientation == row["orientation_at_last_flat"]
        assert getup.strategy in STRATEGIES
