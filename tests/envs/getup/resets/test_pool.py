from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tiny_task import LATENT, changed, getups, supine

from getup_jax.config import ConfigError
from getup_jax.config.load import load_config
from getup_jax.core.resources import asset_path
from getup_jax.envs.getup.build import build_task, say_which_lie
from getup_jax.envs.getup.episode import CLIP, LYING, STANDING
from getup_jax.envs.getup.resets.archived_states import (
    SHIPPED,
    FoundPath,
    load_path,
    load_paths,
    save_path,
)
from getup_jax.envs.getup.resets.lying import Starts
from getup_jax.envs.getup.resets.pool import FlatStarts, angle_gap, build_pool, kind_shares
from getup_jax.motion.clips import GetUp
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.curve_alignment import FEATURE_SCALE
from getup_jax.pose_prior.data import pose_conditions

ACTION = LATENT + 49
SETTINGS = changed(stand_start=0.2, reference_start=0.3, pool_size=60)


def make_pool(styles, character, engine, config=SETTINGS, **flat):
    """The pool of the styles on the flat plane; flat: other arguments of `FlatStarts`."""
    flat = {"seed": 0, "action_size": ACTION, **flat}
    starts = FlatStarts(styles, character, config.task, config.curriculum, **flat)
    return build_pool(starts, engine, print)


def pool_of(character, engine, **changes):
    return make_pool(getups(character), character, engine, changed(SETTINGS, **changes))


def rows(pool, kind: int, style: int) -> dict[str, np.ndarray]:
    index = np.asarray(pool.table[kind, 0, style])
    state = pool.physics.kinematics
    return {
        "qpos": np.asarray(state.qpos)[index],
        "qvel": np.asarray(state.qvel)[index],
        "time": np.asarray(pool.time)[index],
    }


@pytest.fixture(scope="module")
def pool(character, engine):
    return pool_of(character, engine)


def test_every_kind_and_style_has_its_share_of_the_pool(pool):
    # 60 rows of three kinds and two styles
    assert pool.table.shape == (3, 1, 2, 10)
    np.testing.assert_array_equal(np.sort(np.ravel(pool.table)), np.arange(60))
    assert pool.time.shape == (60,)
    assert np.asarray(pool.physics.kinematics.finite).all()


def test_a_kind_without_a_share_has_one_row_a_style(character, engine):
    pool = pool_of(character, engine, stand_start=0.0, reference_start=0.0)
    assert pool.table.shape == (3, 1, 2, 30)
    assert len(np.unique(pool.table[LYING])) == 60
    assert len(np.unique(pool.table[STANDING])) == 2
    assert len(np.unique(pool.table[CLIP])) == 2


def test_the_shares_of_the_kinds_are_in_their_order():
    shares = kind_shares(SETTINGS.task, SETTINGS.training_aids)
    assert shares[LYING] == pytest.approx(0.5)
    assert (shares[STANDING], shares[CLIP]) == (0.2, 0.3)


@pytest.mark.parametrize("style", [0, 1])
def test_lying_starts_rest_on_the_floor_at_the_start_of_the_curve(pool, style):
    start = rows(pool, LYING, style)
    np.testing.assert_array_equal(start["time"], 0.0)
    assert (start["qpos"][:, 2] < 0.15).all()
    assert np.abs(start["qvel"][:, :3]).max() < 0.5


def test_standing_starts_stand_still_at_the_end_of_the_curve(pool, character):
    start = rows(pool, STANDING, 1)
    np.testing.assert_array_equal(start["time"], 2.0)
    np.testing.assert_array_equal(start["qvel"], 0.0)
    neutral = np.tile(character.neutral_qpos[7:], (10, 1))
    np.testing.assert_allclose(start["qpos"][:, 7:], neutral, atol=1e-6)


def test_starts_have_any_heading(pool):
    quaternion = rows(pool, STANDING, 0)["qpos"][:, 3:7]
    yaw = Rotation.from_quat(quaternion, scalar_first=True).as_rotvec()[:, 2]
    assert np.ptp(yaw) > 2.0


def test_starts_along_the_clip_move_like_it(pool, character):
    clip = getups(character)[0].clip
    start = rows(pool, CLIP, 0)
    frame = np.round(start["time"] * clip.fps).astype(int)
    assert set(frame) == {0, 1}  # the last frame has no velocity
    np.testing.assert_allclose(start["time"], frame / clip.fps, atol=1e-6)
    np.testing.assert_allclose(start["qpos"][:, 3:], clip.qpos[frame, 3:], atol=1e-6)
    climb = clip.fps * (clip.qpos[frame + 1, 2] - clip.qpos[frame, 2])
    np.testing.assert_allclose(start["qvel"][:, 2], climb, atol=1e-5)


def test_a_curve_alone_starts_along_the_motion_that_looks_most_like_it(pool, character):
    _, curve = getups(character)
    start = rows(pool, CLIP, 1)
    assert start["time"].max() > 0.5
    target = np.asarray(curves.evaluate(jnp.asarray(curve.points), start["time"] / curve.duration))
    gap = np.abs(pose_conditions(start["qpos"], character) - target)
    assert (gap[:, 1:] < FEATURE_SCALE[1:] + 1e-3).all()
    assert (gap[:, 0] < FEATURE_SCALE[0] + 0.2).all()  # the pose is put on the ground
    # the hinges of all three frames are those of the neutral pose
    neutral = np.tile(character.neutral_qpos[7:], (10, 1))
    np.testing.assert_allclose(start["qpos"][:, 7:], neutral, atol=1e-6)
    # pitching up, at most an eighth of a turn a frame and a frame in the nine samples of smoothing
    sample = curve.duration / 95
    limit = np.pi / 4 / (9 * sample) + 0.5
    assert np.abs(start["qvel"][:, 3:6]).max() < limit


def limp_bodies(character) -> Starts:
    """Four bodies on the back, each with another bend of the knee, and one upright."""
    qpos = np.tile(supine(character), (5, 1))
    qpos[4] = character.neutral_qpos
    for number, row in enumerate(qpos):
        row[7 + character.joint("shin_l_flex")] = 0.1 * number
    return Starts(qpos, np.full((5, character.model.nv), 0.01), np.zeros(5, int))


def test_a_share_of_the_lying_starts_are_limp_bodies_that_fit(pool, character, engine):
    limp = limp_bodies(character)
    config = changed(SETTINGS, limp_share=0.4)
    mixed = make_pool(getups(character), character, engine, config, limp=limp)
    for style in range(2):
        start, own = rows(mixed, LYING, style), rows(pool, LYING, style)
        found = [np.abs(row - limp.qpos).max(axis=1).argmin() for row in start["qpos"][:4]]
        assert sorted(found) == [0, 1, 2, 3]  # each once, and the upright one does not fit
        np.testing.assert_allclose(start["qpos"][:4], limp.qpos[found], atol=1e-6)
        np.testing.assert_allclose(start["qvel"][:4], 0.01)
        np.testing.assert_array_equal(start["qpos"][4:], own["qpos"][4:])
    for kind in (STANDING, CLIP):  # and all the others are as without them
        for name, value in rows(mixed, kind, 0).items():
            np.testing.assert_array_equal(value, rows(pool, kind, 0)[name])


def test_a_style_that_no_limp_body_fits_keeps_its_own_poses(pool, character, engine, capsys):
    limp = limp_bodies(character).take(np.array([4]))
    config = changed(SETTINGS, limp_share=1.0)
    mixed = make_pool(getups(character), character, engine, config, limp=limp)
    np.testing.assert_array_equal(rows(mixed, LYING, 0)["qpos"], rows(pool, LYING, 0)["qpos"])
    assert capsys.readouterr().out.strip() == (
        "start states: no limp body on flat ground fits clip, curve"
    )


def found_path(character, time: np.ndarray) -> FoundPath:
    count = len(time)
    return FoundPath(
        qpos=np.tile(character.neutral_qpos, (count, 1)),
        qvel=np.full((count, 55), 0.25),
        action=np.tile(time[:, None], (1, ACTION)),
        time=time,
        task_reward=np.ones(count),
        finished=True,
        seed=3,
    )


def test_starts_along_the_way_are_found_states_where_there_are_any(character, engine, tmp_path):
    style = getups(character)[1]
    save_path(tmp_path, style, found_path(character, np.array([0.0, 0.2, 0.4, 0.6, 0.8])))
    pool = pool_of(character, engine, archive=str(tmp_path), archive_share=1.0)
    start = rows(pool, CLIP, 1)
    action = np.asarray(pool.action)[np.asarray(pool.table[CLIP, 0, 1])]
    found = start["time"] < 0.9
    assert found.any()
    np.testing.assert_allclose(action[found], np.tile(start["time"][found, None], (1, ACTION)))
    np.testing.assert_allclose(start["qvel"][found], 0.25)
    neutral = np.tile(character.neutral_qpos, (found.sum(), 1))
    np.testing.assert_allclose(start["qpos"][found], neutral, atol=1e-6)
    assert np.isnan(action[~found]).all()
    others = np.asarray(pool.action)[np.asarray(pool.table[:, 0, 0])]
    assert np.isnan(others).all()


def test_a_found_path_reads_as_it_was_written(character, tmp_path):
    style = getups(character)[0]
    path = found_path(character, np.linspace(0.0, 1.0, 5))
    file = save_path(tmp_path, style, path)
    assert file.name == "clip.3.npz"
    for name, value in vars(load_path(file)).items():
        np.testing.assert_array_equal(value, getattr(path, name))
    assert list(path.near(0.5, 0.3)) == [1, 2, 3]


def test_the_shipped_paths_are_of_the_shipped_character(character):
    files = sorted(asset_path("paths").glob("*.npz"))
    assert len(files) == 20
    points = getups(character)[0].points
    styles = [GetUp(file.name.split(".0.npz")[0], 1.0, points) for file in files]
    for path in load_paths(SHIPPED, styles, character.num_joints, ACTION):
        assert path is not None
        assert len(path.time) > 0
        assert np.isfinite(path.qpos).all()
        assert np.isfinite(path.action).all()
        np.testing.assert_allclose(np.linalg.norm(path.qpos[:, 3:7], axis=1), 1.0, atol=1e-4)


def test_without_a_pose_prior_a_found_state_has_no_action(character, tmp_path):
    style = getups(character)[0]
    path = found_path(character, np.zeros(2))
    save_path(tmp_path, style, path)
    (found,) = load_paths(str(tmp_path), [style], character.num_joints, character.num_joints)
    assert found is not None
    np.testing.assert_array_equal(found.qpos, path.qpos)
    assert found.action.shape == (len(path.time), character.num_joints)
    assert np.isnan(found.action).all()


def test_paths_that_cannot_be_used_say_why(character, engine, tmp_path):
    with pytest.raises(ConfigError, match=r"curriculum\.archive: no folder .*getup-search"):
        pool_of(character, engine, archive=str(tmp_path / "none"))
    logged: list[str] = []
    with pytest.raises(ConfigError, match=r"curriculum\.archive: no folder"):
        build_task(load_config("flat", [f"curriculum.archive={tmp_path}/none"]), logged.append)
    assert not logged  # before the motions are read
    style = getups(character)[0]
    file = save_path(tmp_path, style, found_path(character, np.zeros(2)))
    config = changed(SETTINGS, archive=str(tmp_path))
    with pytest.raises(ConfigError, match="expected 56 positions and 70 actions, got 56 and 65"):
        make_pool(getups(character), character, engine, config, action_size=70)
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(ConfigError, match=r"clip\.3\.npz: not a path that getup-search wrote"):
        pool_of(character, engine, archive=str(tmp_path))


def test_a_curve_unlike_every_frame_starts_lying_instead(character, engine):
    clip, curve = getups(character)
    points = curve.points + np.array([0.5, 0.0, 0.0])
    curve = dataclasses.replace(curve, points=points)
    pool = make_pool([clip, curve], character, engine)
    start = rows(pool, CLIP, 1)
    np.testing.assert_array_equal(start["time"], 0.0)
    assert (start["qpos"][:, 2] < 0.15).all()


def test_noise_stays_inside_the_joint_limits(character, engine):
    noisy = pool_of(character, engine, start_noise_rad=0.3)
    joints = rows(noisy, STANDING, 0)["qpos"][:, 7:]
    assert joints.std(axis=0).mean() > 0.1
    assert (joints >= character.joint_lower - 1e-6).all()
    assert (joints <= character.joint_upper + 1e-6).all()


def test_the_same_seed_gives_the_same_pool(pool, character, engine):
    again = pool_of(character, engine)
    np.testing.assert_array_equal(again.physics.engine, pool.physics.engine)


def test_a_curve_that_starts_unlike_every_pose_is_an_error(character, engine):
    clip, curve = getups(character)
    points = curve.points.copy()
    points[0, 2] = 1.0  # the front angle of a supine pose is 0
    curve = dataclasses.replace(curve, points=points)
    assert angle_gap(clip.clip.qpos[0], curve, character) == pytest.approx(1.0, abs=0.05)
    with pytest.raises(
        ConfigError, match=r"'curve': .* 1\.0\d rad .*task\.curve_match_rad = 0\.52"
    ):
        make_pool([clip, curve], character, engine)


def test_a_wider_match_accepts_it(character, engine):
    clip, curve = getups(character)
    points = curve.points.copy()
    points[0, 2] = 1.0
    curve = dataclasses.replace(curve, points=points)
    config = changed(SETTINGS, curve_match_rad=1.2)
    pool = make_pool([clip, curve], character, engine, config)
    assert pool.table.shape == (3, 1, 2, 10)


def test_curves_that_lie_for_long_are_named():
    points = np.tile([0.1, 1.57, 0.0], (curves.NUM_POINTS, 1))
    said: list[str] = []
    say_which_lie([GetUp("waits", 2.0, points), GetUp("rises", 0.9, points)], SETTINGS, said.append)
    (line,) = said
    assert line.endswith("more than 0.3 s ends the episode; begin them later: waits (2.0 s)")
