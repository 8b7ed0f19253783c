"""Every shipped motion and curve, and the poses made from them."""

import mujoco
import numpy as np
import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.core.resources import asset_path
from getup_jax.motion.authoring.contact_ik import CONTACT_NAMES, Planter, geom_bottoms
from getup_jax.motion.authoring.keyframes import authored_poses, load_authored, read_keyframes
from getup_jax.motion.authoring.library import read_drawn
from getup_jax.motion.clips import MotionError
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.events import link_positions
from getup_jax.motion.getup.getups import clip_features
from getup_jax.physics.character import load_character

NAMES = sorted(path.stem for path in asset_path("motions").glob("*.yaml"))
DRAWN = sorted(path.stem for path in asset_path("curves").glob("*.yaml"))


@pytest.fixture(scope="module")
def library(character):
    return {getup.name: getup for getup in load_authored(character)}


def test_a_body_of_the_same_shapes_gets_the_same_arrays_read_only(library, character):
    again = load_authored(load_character(PhysicsConfig(gain_scale=2.0)))
    assert all(getup.points is library[getup.name].points for getup in again)
    with pytest.raises(ValueError, match="read-only"):
        again[0].points[0, 0] = 0.0
    again.clear()
    assert len(load_authored(character)) == 28


@pytest.fixture(scope="module")
def shapes(library, character):
    """Features [F, 3] of every reference motion."""
    return {
        name: clip_features(link_positions(library[name].clip, character), character)
        for name in NAMES
    }


@pytest.fixture(scope="module")
def poses(library, character):
    return authored_poses(list(library.values()), character, 20_000, noise_rad=0.05, seed=1)


def test_the_published_set_is_13_references_and_5_styles_at_3_durations(library):
    references = [getup for getup in library.values() if getup.clip is not None]
    assert (len(library), len(references), len(DRAWN)) == (28, 13, 5)
    assert len({getup.strategy for getup in references}) >= 5
    assert all(2.5 <= getup.duration <= 6.0 for getup in references)
    starts = {name.split("_")[0] for name in NAMES}
    assert starts == {"supine", "prone", "side"}


@pytest.mark.parametrize("name", NAMES)
def test_motion_is_inside_limits_and_smooth(name, library, character):
    clip = library[name].clip
    joints = clip.qpos[:, 7:]
    assert np.all(joints >= character.joint_lower - 1e-9)
    assert np.all(joints <= character.joint_upper + 1e-9)
    assert np.abs(np.diff(joints, axis=0)).max() < 0.5
    assert np.linalg.norm(np.diff(clip.qpos[:, :3], axis=0), axis=1).max() * clip.fps < 2.0
    assert clip.fps == pytest.approx(30.0, rel=0.01)


@pytest.mark.parametrize("name", NAMES)
def test_motion_touches_the_floor_and_not_itself(name, library, character):
    model, data = character.model, mujoco.MjData(character.model)
    for qpos in library[name].clip.qpos:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        assert abs(geom_bottoms(model, data.geom_xpos, data.geom_xmat).min()) < 0.02
        own = np.all(model.geom_bodyid[data.contact.geom] > 0, axis=1)
        assert np.all(data.contact.dist[own] > -0.015)


@pytest.mark.parametrize("name", NAMES)
def test_motion_starts_lying_and_ends_standing_still(name, library, shapes, character):
    clip = library[name].clip
    values = shapes[name]
    assert values[0, 0] < 0.45
    np.testing.assert_allclose(clip.qpos[-1, 7:], character.neutral_qpos[7:], atol=1e-6)
    np.testing.assert_allclose(values[-1, 1:], np.pi / 2, atol=0.02)
    last = clip.qpos[-round(0.3 * clip.fps) :]
    assert np.abs(last - last[-1]).max() < 0.02
    tilt = {"supine": 0.0, "prone": np.pi, "side": np.pi / 2}[name.split("_")[0]]
    assert values[0, 2] == pytest.approx(tilt, abs=0.3)


@pytest.mark.parametrize("name", NAMES)
def test_planted_contacts_do_not_slide(name, library, character):
    motion = read_keyframes(asset_path("motions", f"{name}.yaml"), character)
    clip, planter = library[name].clip, Planter(character)
    for first, second in zip(motion.keyframes[:-1], motion.keyframes[1:], strict=True):
        inside = clip.qpos[round(first.time * clip.fps) : round(second.time * clip.fps) + 1]
        for contact in first.planted:
            path = np.stack([planter.poses(q, [contact])[contact][:3] for q in inside])
            assert np.linalg.norm(path - path[0], axis=1).max() < 0.06, (contact, first.time)
    assert set(CONTACT_NAMES) >= {c for key in motion.keyframes for c in key.planted}


@pytest.mark.parametrize("name", NAMES)
def test_curves_fit_their_motion(name, library):
    height, side, front = library[name].fit_error
    assert height < 0.06
    assert max(side, front) < 0.15


@pytest.mark.parametrize("name", DRAWN)
def test_drawn_styles_are_well_formed(name, library):
    three = [getup for key, getup in library.items() if key.startswith(f"{name}@")]
    assert [getup.duration for getup in three] == [2.5, 5.1, 7.6]
    points = three[0].points
    assert points.shape == (curves.NUM_POINTS, 3)
    assert np.all((points[:, 1:] >= 0) & (points[:, 1:] <= np.pi))
    assert np.all((points[:, 0] > 0.05) & (points[:, 0] < 1.5))
    np.testing.assert_allclose(points[-1, 1:], np.pi / 2, atol=1e-6)
    assert all(getup.clip is None and getup.strategy for getup in three)


@pytest.mark.parametrize("name", DRAWN)
def test_drawn_styles_start_like_the_motion_they_name_and_end_standing(name, library):
    path = asset_path("curves", f"{name}.yaml")
    start = next(k for k in NAMES if f"start: {k} " in path.read_text(encoding="utf-8"))
    drawn, reference = library[f"{name}@2.5"].points, library[start].points
    np.testing.assert_allclose(drawn[0], reference[0], atol=0.1)
    assert drawn[-1, 0] == pytest.approx(reference[-1, 0], abs=0.01)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("start: ", "start: not_", "start: expected one of .*got 'not_"),
        ("height: [", "height: [0.1, ", "height: expected 9 numbers"),
        ("strategy:", "stratagy:", "expected the keys name, strategy"),
    ],
)
def test_a_wrong_curve_file_says_what_is_wrong(old, new, message, tmp_path):
    text = asset_path("curves", f"{DRAWN[0]}.yaml").read_text(encoding="utf-8")
    path = tmp_path / f"{DRAWN[0]}.yaml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(MotionError, match=f"{DRAWN[0]}(.yaml)?: {message}"):
        read_drawn(path, NAMES)


def test_poses_are_many_inside_limits_and_on_the_floor(poses, character):
    assert poses.shape == (20_000, 7 + character.num_joints)
    assert np.all(np.isfinite(poses))
    assert np.all(poses[:, 7:] >= character.joint_lower - 1e-9)
    assert np.all(poses[:, 7:] <= character.joint_upper + 1e-9)
    np.testing.assert_allclose(np.linalg.norm(poses[:, 3:7], axis=1), 1.0, atol=1e-9)
    data = mujoco.MjData(character.model)
    for qpos in poses[::500]:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(character.model, data)
        lowest = geom_bottoms(character.model, data.geom_xpos, data.geom_xmat).min()
        assert lowest == pytest.approx(0.0, abs=1e-6)


def test_poses_vary_and_repeat_with_their_seed(poses, library, character):
    getups = list(library.values())
    again, other = (authored_poses(getups, character, 6000, 0.05, seed) for seed in (1, 2))
    np.testing.assert_array_equal(again[:100], poses[:100])
    assert not np.array_equal(again[-100:], other[-100:])
    assert len(np.unique(poses.round(6), axis=0)) > 0.95 * len(poses)
    few = authored_poses(getups, character, 10, 0.05, 0)
    np.testing.assert_array_equal(few, getups[0].clip.qpos[:10])


def test_poses_need_a_clip(library, character):
    drawn = [getup for getup in library.values() if getup.clip is None]
    with pytest.raises(ValueError, match="no get-up has a clip"):
        authored_poses(drawn, character, 10, 0.05, 0)
