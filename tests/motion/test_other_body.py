"""The authored library on bodies of other packages."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

from getup_jax.cli import main as cli
from getup_jax.config import PhysicsConfig
from getup_jax.core.resources import asset_path
from getup_jax.motion.authoring.keyframe_clip import clip_from_keyframes
from getup_jax.motion.authoring.keyframe_file import read_keyframes
from getup_jax.motion.authoring.library import load_authored, read_drawn
from getup_jax.motion.authoring.other_body import carried_over, neck_height, sized, takes_angles
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.events import link_positions
from getup_jax.motion.getup.getups import clip_features, evenly
from getup_jax.motion.retarget.body import record
from getup_jax.motion.retarget.retarget import RetargetSettings, retarget
from getup_jax.physics.character import load_character
from own_bodies import documented


@pytest.fixture(scope="module")
def dm_map(tmp_path_factory):
    """The map that the documentation shows, and the package that it names."""
    pytest.importorskip("dm_control")
    file = tmp_path_factory.mktemp("dm") / "dm_humanoid.yaml"
    file.write_text(documented())
    return str(file)


@pytest.fixture(scope="module")
def dm(dm_map):
    return load_character(PhysicsConfig(character=dm_map))


@pytest.fixture(scope="module")
def clip(character):
    motion = read_keyframes(asset_path("motions", "supine_bridge_half_kneel.yaml"), character)
    return clip_from_keyframes(motion, character)


def test_the_default_body_takes_the_angles_as_they_are(character):
    assert takes_angles(load_character(PhysicsConfig(gain_scale=2.0)), character)
    assert not takes_angles(load_character(PhysicsConfig(character="humanoid28")), character)


def test_a_motion_is_carried_to_a_shipped_body_of_other_hinges(character, clip, cache):
    """Links end up as far apart as they were, in the sizes of the other body; then it is kept."""
    other = load_character(PhysicsConfig(character="humanoid28"))
    short = dataclasses.replace(clip, qpos=clip.qpos[::6], fps=clip.fps / 6)
    found = carried_over(short, character, other)
    assert found.qpos.shape == (len(short.qpos), 7 + 28)
    _, report = retarget(record(short, character), other, RetargetSettings(fps=short.fps))
    assert report.position_error_m < 0.04
    heights = [
        link_positions(c, b)[:, b.link("pelvis"), 2]
        for c, b in ((found, other), (short, character))
    ]
    ratio = other.neutral_qpos[2] / character.neutral_qpos[2]
    np.testing.assert_allclose(heights[0], ratio * heights[1], atol=0.06)
    assert len(list((cache / "clips").glob("*.npz"))) == 1
    again = carried_over(short, character, other)
    np.testing.assert_allclose(again.qpos, found.qpos, atol=1e-6)


def test_the_body_of_the_page_is_whole(dm):
    assert len(dm.joint_names) == 21
    assert dm.link_names[0] == "pelvis"
    assert dm.neutral_qpos[2] == pytest.approx(0.86, abs=0.02)


def test_its_motions_end_standing_and_their_curves_are_its_own(dm, character, clip, cache):
    found = carried_over(clip, character, dm)
    assert found.qpos[-1, 2] == pytest.approx(dm.neutral_qpos[2], abs=0.03)
    assert found.qpos[0, 2] < 0.15
    data = mujoco.MjData(dm.model)
    data.qpos[:] = found.qpos[-1]
    mujoco.mj_kinematics(dm.model, data)
    for side in "lr":
        assert data.geom(f"foot_{side}").xpos[2] < 0.03
    points, _ = curves.fit(evenly(clip_features(link_positions(found, dm), dm), 256))
    assert points[-1, 0] == pytest.approx(neck_height(dm), abs=0.03)
    np.testing.assert_allclose(points[-1, 1:], np.pi / 2, atol=0.1)
    _, report = retarget(record(clip, character), dm, RetargetSettings(fps=clip.fps))
    assert report.position_error_m < 0.035


def test_drawn_heights_are_scaled_by_the_neck(dm, character):
    style = read_drawn(asset_path("curves", "sit_up_squat_late.yaml"), ["supine_situp_squat"])[0]
    small = sized(style, character, dm)
    ratio = neck_height(dm) / neck_height(character)
    assert 0.9 < ratio < 0.99
    np.testing.assert_allclose(small.points[:, 0], ratio * style.points[:, 0])
    np.testing.assert_array_equal(small.points[:, 1:], style.points[:, 1:])
    assert sized(style, character, character) is style


@pytest.mark.slow
def test_the_documented_command_trains(dm_map, dm, tmp_path, cache):
    assert len(load_authored(dm)) == 28
    settings = [f"physics.character={dm_map}", "curriculum.archive=null", "prior=null"]
    settings += ["motion.augment_poses=100", "motion.curves=[supine_situp_squat]"]
    settings += ["task.pool_size=16", "ppo.num_envs=8", "ppo.num_steps=8", "ppo.minibatch_size=64"]
    settings += ["train.total_steps=128", "physics.threads=1"]
    run = tmp_path / "run"
    assert cli.train_main(["flat", *settings, "--run", str(run)]) == 0
    assert (run / "metrics.jsonl").read_text().count("\n") >= 2
