from __future__ import annotations

import csv
import io

import mujoco
import numpy as np
import pytest

from getup_jax.config import ConfigError
from getup_jax.editor import export as exports
from getup_jax.editor.export import export
from getup_jax.editor.simulate import link_poses
from getup_jax.motion.io.bvh import read_bvh
from getup_jax.motion.io.curve_file import parse_text
from getup_jax.motion.io.recording import forward, scaled
from getup_jax.motion.retarget.cache import read_npz

MILLIMETRE = 0.001


def test_a_bvh_file_has_every_link_where_it_was(motion, simulator, tmp_path):
    path = tmp_path / "motion.bvh"
    path.write_bytes(export(motion, simulator.character, "bvh"))
    recording = scaled(read_bvh(path), 0.01)  # BVH files are in centimetres
    position, rotation = forward(recording)
    order = [recording.joint(name) for name in simulator.character.link_names]
    links = motion.frames.links
    assert np.abs(position[:, order] - links[..., :3]).max() < MILLIMETRE
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, links[-1, 0, 3:].astype(np.float64))
    np.testing.assert_allclose(rotation[-1, order[0]], matrix.reshape(3, 3), atol=1e-4)
    assert recording.fps == pytest.approx(30.0, rel=1e-6)


def test_a_bvh_file_stands_along_y_in_centimetres(motion, simulator):
    text = export(motion, simulator.character, "bvh").decode()
    name, offset = "shin_l", None
    lines = iter(text.splitlines())
    for line in lines:
        if line.strip() == f"JOINT {name}":
            next(lines)
            offset = [float(x) for x in next(lines).split()[1:]]
    body = simulator.character.model.body(name)
    # down the thigh is -z here, and -y in the file
    np.testing.assert_allclose(offset, 100 * body.pos[[1, 2, 0]], atol=1e-4)
    assert offset[1] < -30


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


def test_a_glb_file_has_the_motion_as_an_animation(motion, simulator):
    gltf = pytest.importorskip("pygltflib")
    document = gltf.GLTF2.load_from_bytes(export(motion, simulator.character, "glb"))
    (animation,) = document.animations
    assert animation.name == motion.curve.name
    clock = document.accessors[animation.samplers[0].input]
    assert clock.count == len(motion.frames.qpos)
