from __future__ import annotations

import csv
import dataclasses
import io

import mujoco
import numpy as np
import pytest
from glb_reading import link_places, read_glb

from getup_jax.config import ConfigError
from getup_jax.editor import export as exports
from getup_jax.editor.export import export
from getup_jax.editor.simulate import link_poses
from getup_jax.editor.takes import RATES, WHOLE, Cut
from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.bvh import read_bvh
from getup_jax.motion.io.curve_file import parse_text
from getup_jax.motion.io.recording import forward, scaled
from getup_jax.motion.retarget.cache import read_npz

MILLIMETRE = 0.001


def with_start(motion) -> np.ndarray:
    """All poses of a motion, from 0 s on."""
    return np.concatenate([motion.start_pose[None], motion.frames.qpos])


def front(position: np.ndarray) -> np.ndarray:
    """Positions [..., 3] with the quarter turn that makes the rest pose face +Z in the file."""
    return position[..., [1, 0, 2]] * [1.0, -1.0, 1.0]


def bvh(motion, simulator, folder, cut=WHOLE):
    path = folder / "motion.bvh"
    path.write_bytes(export(motion, simulator.character, "bvh", cut))
    return scaled(read_bvh(path), 0.01)  # BVH files are in centimetres


def test_a_bvh_file_has_every_link_where_it_was_from_0_s_on(motion, simulator, tmp_path):
    recording = bvh(motion, simulator, tmp_path)
    position, _ = forward(recording)
    order = [recording.joint(name) for name in simulator.character.link_names]
    links = link_poses(simulator.character, with_start(motion))
    assert len(position) == len(motion.frames.qpos) + 1
    assert np.abs(position[:, order] - front(links[..., :3])).max() < MILLIMETRE
    assert recording.fps == pytest.approx(30.0, rel=1e-6)


def test_a_bvh_file_rests_as_a_t_that_faces_z_and_stands_along_y(motion, simulator):
    offsets = {}
    for line in export(motion, simulator.character, "bvh").decode().splitlines():
        words = line.split()
        if words and words[0] in ("ROOT", "JOINT"):
            name = words[1]
        elif words and words[0] == "OFFSET" and name not in offsets:
            offsets[name] = np.array([float(x) for x in words[1:]])
    model = simulator.character.model
    # down the thigh is -z here, and -y in the file
    shin = 100 * model.body("shin_l").pos[[1, 2, 0]]
    np.testing.assert_allclose(offsets["shin_l"], shin, atol=1e-3)
    assert offsets["shin_l"][1] < -30
    for side, sign in (("l", 1), ("r", -1)):  # seen from +Z, its left is +X
        for name in (f"forearm_{side}", f"hand_{side}"):
            along = sign * offsets[name] / np.linalg.norm(offsets[name])
            np.testing.assert_allclose(along, [1.0, 0.0, 0.0], atol=1e-4)


def test_a_bvh_file_has_no_jumps_of_angles(motion, simulator):
    """Half turns about the vertical, past every seam of the angles."""
    turning = np.tile(simulator.character.neutral_qpos, (90, 1))
    half = np.linspace(0.0, 3.0 * np.pi, 90) / 2
    turning[:, 3], turning[:, 6] = np.cos(half), np.sin(half)
    frames = dataclasses.replace(motion.frames, qpos=turning[1:])
    whole = dataclasses.replace(motion, frames=frames, start_pose=turning[0])
    text = export(whole, simulator.character, "bvh").decode()
    rows = [line.split() for line in text[text.index("Frame Time") :].splitlines()[1:]]
    assert np.abs(np.diff(np.array(rows, float)[:, 3:], axis=0)).max() < 10.0


@pytest.mark.parametrize("rate", RATES)
def test_a_part_at_another_rate_is_the_same_motion(motion, simulator, tmp_path, rate):
    recording = bvh(motion, simulator, tmp_path, Cut(rate, 0.2, 0.8))
    assert recording.fps == pytest.approx(rate, rel=1e-5)
    assert recording.num_frames == int(0.6 * rate + 1e-6) + 1
    position, _ = forward(recording)
    root = recording.joint(simulator.character.link_names[0])
    known = np.arange(len(with_start(motion))) / 30.0
    times = 0.2 + np.arange(recording.num_frames) / rate
    places = with_start(motion)[:, :3]
    wanted = np.stack([np.interp(times, known, column) for column in places.T], axis=1)
    assert np.abs(position[:, root] - front(wanted)).max() < MILLIMETRE


def test_a_part_without_frames_is_refused(motion, simulator):
    with pytest.raises(MotionError, match=r"at least two frames, got 0\.5 s to 0\.5 s; move in or"):
        export(motion, simulator.character, "bvh", Cut(None, 0.5, 0.5))


def test_an_npz_file_is_a_clip_and_more(motion, simulator, tmp_path):
    path = tmp_path / "motion.npz"
    path.write_bytes(export(motion, simulator.character, "npz"))
    clip, report = read_npz(path, simulator.character)
    np.testing.assert_array_equal(clip.qpos.astype(np.float32), motion.frames.qpos)
    assert clip.fps == pytest.approx(30.0)
    assert report.frames == len(clip.qpos)
    with np.load(path) as data:
        np.testing.assert_array_equal(data["link_position"], motion.frames.links[..., :3])
        assert parse_text(str(data["curve"]), "curve").plain() == motion.curve.plain()


def test_a_csv_file_has_a_column_for_everything(motion, simulator):
    text = export(motion, simulator.character, "csv").decode()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == len(motion.time)
    last = rows[-1]
    assert float(last["time_s"]) == pytest.approx(motion.time[-1], abs=1e-4)
    assert float(last["target_height_m"]) == pytest.approx(motion.target[-1, 0], abs=1e-5)
    index = 7 + simulator.character.joint("thigh_l_flex")
    found = float(last["thigh_l_flex_rad"])
    assert found == pytest.approx(motion.frames.qpos[-1, index], abs=1e-5)
    assert len(last) == 2 + 6 + 7 + simulator.character.num_joints


def test_a_film_needs_the_extra(motion, simulator, monkeypatch):
    def missing():
        raise ConfigError("--video: needs imageio")

    monkeypatch.setattr(exports.film, "require", missing)
    with pytest.raises(ConfigError, match="needs imageio"):
        export(motion, simulator.character, "mp4")


def test_link_poses_are_those_of_mujoco(simulator):
    pose = simulator.character.neutral_qpos
    data = mujoco.MjData(simulator.character.model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(simulator.character.model, data)
    np.testing.assert_allclose(
        link_poses(simulator.character, pose[None])[0],
        np.c_[data.xpos[1:], data.xquat[1:]],
        atol=1e-6,
    )


def test_a_glb_file_has_the_motion_to_a_millimetre(motion, simulator):
    document = read_glb(export(motion, simulator.character, "glb", Cut(60)))
    (animation,) = document.animations
    assert animation.name == motion.curve.name
    places = link_places(document)
    links = simulator.character.link_names
    assert list(places) == list(links)
    found = np.stack([places[name] for name in links], axis=1)
    assert len(found) == 2 * len(motion.frames.qpos) + 1
    wanted = link_poses(simulator.character, with_start(motion))
    assert np.abs(found[::2] - wanted[..., :3]).max() < MILLIMETRE
