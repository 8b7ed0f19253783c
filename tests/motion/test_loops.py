"""The authored loops of composite motion: they close, their feet stay, their jumps fall freely."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.core.resources import asset_path
from getup_jax.motion.authoring.contact_ik import Planter
from getup_jax.motion.authoring.keyframes import KeyframeMotion, clip_from_keyframes, read_keyframes
from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.io.readers import read_motion
from getup_jax.motion.retarget.retarget import retarget
from getup_jax.physics.character import CharacterSpec, load_character

FOLDER = asset_path("motions", "composite")
NAMES = sorted(path.stem for path in FOLDER.glob("*.yaml"))


@pytest.fixture(scope="module")
def humanoid() -> CharacterSpec:
    return load_character(PhysicsConfig(character="humanoid28"))


@pytest.fixture(scope="module")
def loops(humanoid) -> dict[str, tuple[KeyframeMotion, Clip]]:
    motions = [read_keyframes(FOLDER / f"{name}.yaml", humanoid) for name in NAMES]
    return {m.name: (m, clip_from_keyframes(m, humanoid)) for m in motions}


def centres_of_mass(clip: Clip, humanoid: CharacterSpec) -> np.ndarray:
    planter = Planter(humanoid)
    return np.stack([planter.centre_of_mass(pose) for pose in clip.qpos])


@pytest.mark.parametrize("name", NAMES)
def test_pose_and_rate_close(name, loops):
    motion, clip = loops[name]
    assert motion.loop
    first, last = clip.qpos[0], clip.qpos[-1]
    np.testing.assert_allclose(last[2:], first[2:], atol=0.003)
    into = clip.qpos[-1, 7:] - clip.qpos[-2, 7:]
    out = clip.qpos[1, 7:] - clip.qpos[0, 7:]
    turns = np.abs(np.diff(clip.qpos[:, 7:], n=2, axis=0)).max()  # the sharpest inside
    assert np.abs(into - out).max() <= turns + 0.01


@pytest.mark.parametrize("name", NAMES)
def test_planted_contacts_stay(name, loops, humanoid):
    motion, clip = loops[name]
    planter = Planter(humanoid)
    times = np.arange(len(clip.qpos)) / clip.fps
    for first, second in zip(motion.keyframes[:-1], motion.keyframes[1:], strict=True):
        inside = clip.qpos[(times > first.time - 1e-6) & (times < second.time + 1e-6)]
        for contact in first.planted:
            path = np.stack([planter.poses(q, [contact])[contact][:3] for q in inside])
            assert np.ptp(path, axis=0).max() < 0.01, (contact, first.time)


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_deep_in_the_floor_or_in_the_body(name, loops, humanoid):
    data = mujoco.MjData(humanoid.model)
    for pose in loops[name][1].qpos:
        data.qpos[:] = pose
        mujoco.mj_forward(humanoid.model, data)
        assert min((contact.dist for contact in data.contact), default=0.0) > -0.01


@pytest.mark.parametrize(("name", "speed"), [("walk", 1.25), ("crouch_walk", 0.72), ("run", 2.7)])
def test_gaits_advance_straight_ahead(name, speed, loops):
    _, clip = loops[name]
    advance = clip.qpos[-1, :3] - clip.qpos[0, :3]
    np.testing.assert_allclose(advance, [speed * clip.duration, 0.0, 0.0], atol=0.003)


@pytest.mark.parametrize("name", ["walk", "crouch_walk"])
def test_walking_always_has_a_foot_on_the_floor_and_sometimes_two(name, loops):
    motion, _ = loops[name]
    sides = [{contact[-1] for contact in key.planted} for key in motion.keyframes[:-1]]
    assert all(sides)
    assert any(len(side) == 2 for side in sides)
    assert {"l"} in sides
    assert {"r"} in sides


def test_the_squat_keeps_its_weight_over_the_feet(loops, humanoid):
    _, clip = loops["squat"]
    planter = Planter(humanoid)
    edges = planter.poses(clip.qpos[0], ("heel_l", "toes_l"))
    heel, toes = edges["heel_l"][0], edges["toes_l"][0]
    centre = centres_of_mass(clip, humanoid)[:, 0]
    assert heel + 0.03 < centre.min()
    assert centre.max() < toes - 0.03
    assert np.ptp(clip.qpos[:, 2]) > 0.25


def test_running_has_one_foot_on_the_floor_or_none(loops):
    motion, clip = loops["run"]
    sides = [{contact[-1] for contact in key.planted} for key in motion.keyframes[:-1]]
    assert max(len(side) for side in sides) == 1
    aloft = sum(b.time - a.time for a, b in itertools.pairwise(motion.keyframes) if a.airborne)
    np.testing.assert_allclose(aloft, 0.2, atol=0.01)
    assert clip.qpos[:, 2].max() < 0.9


@pytest.mark.parametrize("name", ["leg_lunge", "crouch_walk"])
def test_low_motions_are_low(name, loops):
    _, clip = loops[name]
    standing = loops["squat"][1].qpos[0, 2]
    assert clip.qpos[:, 2].min() < standing - 0.15


@pytest.mark.parametrize(("name", "flights"), [("jumping_jack", 2), ("run", 2)])
def test_jumps_fall_freely(name, flights, loops, humanoid):
    motion, clip = loops[name]
    centre = centres_of_mass(clip, humanoid)
    times = np.arange(len(centre)) / clip.fps
    keys = motion.keyframes
    air = [(a.time, b.time) for a, b in itertools.pairwise(keys) if a.airborne]
    assert len(air) == 2 * flights  # of two parts each
    for (start, _), (_, end) in zip(air[::2], air[1::2], strict=True):
        inside = np.flatnonzero((times > start - 0.01) & (times < end + 0.01))
        fall = np.diff(centre[inside], n=2, axis=0) * clip.fps**2
        np.testing.assert_allclose(fall, np.tile([0, 0, -9.81], (len(fall), 1)), atol=0.02)


LOOP = """
name: nod
loop: {loop}
keyframes:
  - {{time: 0, angles: {{head: [5, 0, 0]}}}}
  - {{time: 0.5, angles: {{head: [10, 0, 0]}}{air}}}
  - {{time: 1.0, position: [0.2, 0, 0.5]{more}}}
"""


def read_nod(tmp_path, humanoid, loop="true", more="", air=""):
    path = tmp_path / "nod.yaml"
    path.write_text(LOOP.format(loop=loop, more=more, air=air))
    return read_keyframes(path, humanoid)


def test_the_last_keyframe_of_a_loop_is_the_first_moved_along(tmp_path, humanoid):
    first, _, last = read_nod(tmp_path, humanoid).keyframes
    np.testing.assert_array_equal(last.qpos[2:], first.qpos[2:])
    np.testing.assert_array_equal(last.qpos[:2], [0.2, 0.0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"loop": "maybe"}, r"nod.yaml: loop: expected true"),
        ({"more": ", rotation: [0, 5, 0]"}, r"time and position alone.*rotation"),
        ({"air": ", airborne: true, planted: [foot_l]"}, r"airborne: .*nothing planted.*foot_l"),
        ({"air": ", airborne: high"}, r"airborne: expected true or false.*'high'"),
    ],
)
def test_broken_loops_are_errors(tmp_path, humanoid, change, message):
    with pytest.raises(MotionError, match=message):
        read_nod(tmp_path, humanoid, **change)


@pytest.mark.parametrize("name", ["gym/front_jumping_jack", "gym/chest_open+walk_in_place"])
def test_published_clips_fit_this_character(name, humanoid, mocap):
    recording = read_motion(mocap / "composite_motion" / "motions" / f"{name}.json")
    clip, report = retarget(recording, humanoid)
    assert report.position_error_m < 0.02
    hinges = clip.qpos[:, 7:]
    assert (hinges >= humanoid.joint_lower - 1e-6).all()
    assert (hinges <= humanoid.joint_upper + 1e-6).all()
