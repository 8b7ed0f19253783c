import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from pose_samples import QUICK, character, manifold_poses

from getup_jax.config import MotionConfig, PriorConfig
from getup_jax.core.resources import asset_path
from getup_jax.motion.library import load_motions
from getup_jax.pose_prior import cache
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.pose_prior import report as prior_report
from getup_jax.pose_prior.data import BLOCK, PoseSet, blocks, make_pose_set, pose_conditions, split
from getup_jax.pose_prior.training import (
    PROGRESS_CALLS,
    Recipe,
    pca_variance,
    train_prior,
)

BRIEF = dataclasses.replace(QUICK, min_updates=30)


def small_set() -> PoseSet:
    return make_pose_set(manifold_poses(60), character())


# --- poses and what is held out


def test_features_of_standing_supine_and_prone():
    spec = character()
    poses = np.tile(spec.neutral_qpos, (3, 1))
    half = np.sqrt(0.5)
    poses[1, 2:7] = 0.1, half, 0, -half, 0  # tipped over backwards
    poses[2, 2:7] = 0.1, half, 0, half, 0
    condition = pose_conditions(poses, spec)
    np.testing.assert_allclose(condition[:, 1], np.pi / 2, atol=1e-4)
    np.testing.assert_allclose(condition[:, 2], [np.pi / 2, 0, np.pi], atol=0.1)
    assert 1.2 < condition[0, 0] < 1.6
    np.testing.assert_allclose(condition[1:, 0], 0.1, atol=0.05)


def test_mirror_images_have_the_mirrored_features_and_the_same_group():
    poses = manifold_poses(60)
    poses[:, 3:7] = np.array([0.9, 0.3, 0.3, 0.1])
    poses = np.concatenate([poses, character().mirror(poses)])
    both = make_pose_set(poses, character(), mirrored=True)
    np.testing.assert_array_equal(both.group[:60], both.group[60:])
    expected = both.condition[:60] * [1, -1, 1] + [0, np.pi, 0]
    np.testing.assert_allclose(both.condition[60:], expected, atol=1e-4)
    with pytest.raises(ValueError, match="got 119"):
        make_pose_set(poses[1:], character(), mirrored=True)


def test_blocks_are_contiguous_and_short_sets_are_cut_finer():
    long = blocks(100 * BLOCK)
    np.testing.assert_array_equal(long, np.repeat(np.arange(100), BLOCK))
    np.testing.assert_array_equal(blocks(20), np.repeat(np.arange(10), 2))
    np.testing.assert_array_equal(blocks(5), np.arange(5))


def test_split_divides_all_rows_and_keeps_groups_whole():
    group = np.tile(blocks(3000), 2)
    train, heldout = split(group, 0.1, seed=3)
    np.testing.assert_array_equal(np.sort(np.concatenate([train, heldout])), np.arange(6000))
    assert not set(group[train]) & set(group[heldout])
    assert len(heldout) == 600
    assert not np.array_equal(heldout, split(group, 0.1, seed=4)[1])


def test_split_leaves_something_on_both_sides():
    for holdout in (0.001, 0.999):
        train, heldout = split(np.array([0, 0, 1]), holdout, seed=0)
        assert len(train)
        assert len(heldout)


def test_bad_poses_are_named():
    poses = manifold_poses(40)
    poses[17, 9] = np.nan
    with pytest.raises(ValueError, match="row 17"):
        make_pose_set(poses, character())
    good = small_set()
    with pytest.raises(ValueError, match=r"condition: expected shape \(60, 3\), got \(59, 3\)"):
        dataclasses.replace(good, condition=good.condition[1:])


# --- training


def test_fewer_poses_than_a_batch_are_one_batch():
    calls = []
    _, report = train_prior(small_set(), BRIEF, lambda *call: calls.append(call))
    assert report.num_poses + report.num_heldout == 60 < BRIEF.batch_size
    assert report.updates == report.epochs == BRIEF.min_updates
    assert np.isfinite(report.heldout_rmse_deg)
    assert len(calls) <= PROGRESS_CALLS
    assert calls[-1][:2] == (report.epochs, report.epochs)
    assert set(calls[-1][2]) == {"reconstruction", "kl"}


def test_the_same_arguments_give_the_same_prior():
    one, two = (train_prior(small_set(), BRIEF)[0] for _ in range(2))
    np.testing.assert_array_equal(one.latent_mean, two.latent_mean)


def recipe(**values):
    arrays = {"learning_rate": 1e-3, "last_rate": 1.0, "weight_decay": 0.0, "input_noise": 0.0}
    arrays |= {"updates": 100.0, "beta": 0.0, **values}
    return Recipe(None, 8, **{name: jnp.float32(value) for name, value in arrays.items()})


def test_the_rate_falls_along_half_a_cosine_and_is_constant_by_default():
    falling = recipe(last_rate=0.1)
    rates = [float(falling.rate(jnp.asarray(count))) for count in (0, 50, 100)]
    np.testing.assert_allclose(rates, [1e-3, 0.55e-3, 1e-4], rtol=1e-5)
    assert float(recipe().rate(jnp.asarray(70))) == pytest.approx(1e-3, rel=1e-7)


def test_weight_decay_shrinks_parameters_without_a_gradient_and_is_off_by_default():
    params = {"kernel": jnp.full(3, 2.0)}
    for decay, expected in ((0.0, 2.0), (0.5, 2.0 * (1 - 1e-3 * 0.5))):
        optimiser = recipe(weight_decay=decay).optimiser
        change, _ = optimiser.update({"kernel": jnp.zeros(3)}, optimiser.init(params), params)
        np.testing.assert_allclose(params["kernel"] + change["kernel"], expected, rtol=1e-6)


def test_every_setting_of_the_recipe_changes_the_prior():
    plain = train_prior(small_set(), BRIEF)[0].latent_mean
    for change in ({"last_rate": 0.0}, {"weight_decay": 0.1}, {"input_noise": 0.1}):
        other = train_prior(small_set(), dataclasses.replace(BRIEF, **change))[0]
        assert np.isfinite(other.latent_mean).all()
        assert not np.array_equal(other.latent_mean, plain), change


def test_pca_variance_of_a_plane_and_of_a_ball():
    rng = np.random.default_rng(0)
    plane = rng.normal(size=(500, 2)) @ rng.normal(size=(2, 10))
    assert pca_variance(plane, 2) == pytest.approx(1.0)
    assert pca_variance(rng.normal(size=(20000, 10)), 5) == pytest.approx(0.5, abs=0.02)


# --- cache


def test_a_cached_prior_is_read_and_not_trained_again(tmp_path, monkeypatch):
    prior, report = cache.cached_prior(small_set(), BRIEF, tmp_path, lambda _: None)
    monkeypatch.setattr(cache, "train_prior", None)
    again, same = cache.cached_prior(small_set(), BRIEF, tmp_path)
    assert same == report
    one, two = pose_prior.to_dict(prior), pose_prior.to_dict(again)
    np.testing.assert_array_equal(one["latent_std"], two["latent_std"])
    kernels = [d["variables"]["params"]["decoder"]["hidden_0"]["kernel"] for d in (one, two)]
    np.testing.assert_array_equal(*kernels)
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".json", ".npz"]


@pytest.mark.parametrize("suffix", [".npz", ".json"])
@pytest.mark.parametrize("damage", ["cut", "empty", "gone"])
def test_a_damaged_cache_is_made_again(tmp_path, suffix, damage):
    config = dataclasses.replace(BRIEF, min_updates=1)
    prior, _ = cache.cached_prior(small_set(), config, tmp_path, lambda _: None)
    (file,) = tmp_path.glob(f"*{suffix}")
    whole = file.read_bytes()
    if damage == "gone":
        file.unlink()
    else:
        file.write_bytes(whole[: len(whole) // 2] if damage == "cut" else b"")
    lines = []
    again, _ = cache.cached_prior(small_set(), config, tmp_path, lines.append)
    np.testing.assert_array_equal(prior.latent_mean, again.latent_mean)
    if (suffix, damage) != (".npz", "gone"):
        assert "damaged" in lines[0]
    lines.clear()
    cache.cached_prior(small_set(), config, tmp_path, lines.append)
    assert lines == []


def test_other_poses_or_settings_are_another_prior():
    poses = small_set()
    prints = {
        cache.fingerprint(poses, BRIEF),
        cache.fingerprint(poses, dataclasses.replace(BRIEF, seed=1)),
        cache.fingerprint(dataclasses.replace(poses, angles=poses.angles + 1e-3), BRIEF),
        cache.fingerprint(dataclasses.replace(poses, group=poses.group[::-1]), BRIEF),
    }
    assert len(prints) == 4
    assert cache.fingerprint(small_set(), BRIEF) in prints


@pytest.mark.parametrize("name", ["last_rate", "weight_decay", "input_noise"])
def test_settings_that_came_later_name_another_prior_once_they_are_used(name):
    used = dataclasses.replace(BRIEF, **{name: 0.25})
    poses = small_set()
    assert cache.fingerprint(poses, used) != cache.fingerprint(poses, BRIEF)


def test_the_shipped_priors_belong_to_the_shipped_motions_and_the_default_settings():
    poses = load_motions(MotionConfig(), character()).poses
    both = make_pose_set(poses, character(), mirrored=True)
    for mirrored in (True, False):
        name = cache.fingerprint(both, PriorConfig(mirror=mirrored))
        prior, report = cache.load_prior(asset_path("priors", f"prior-{name}.npz"))
        assert prior.num_joints == character().num_joints
        assert prior.mirrored == mirrored
        assert report.heldout_rmse_deg < 2.6


# --- what the prior does to bodies


def test_self_penetration_of_a_clear_pose_and_of_a_hand_in_the_trunk():
    spec = character()
    clear = prior_report.self_penetration(spec.neutral_qpos[None, 7:], spec)
    assert clear.share_deep == 0
    folded = np.tile(spec.neutral_qpos[7:], (2, 1))
    folded[1, spec.joint("forearm_l_flex")] = -1.57
    folded[1, spec.joint("arm_l_twist")] = -1.57
    depth = prior_report.self_penetration(folded, spec)
    assert depth.share_deep == 0.5
    assert 0.02 < depth.worst_m < 0.3


def test_features_of_the_same_joints_have_no_error():
    poses = manifold_poses(20)
    condition = pose_conditions(poses, character())
    angles = jnp.asarray(poses[:, 7:])
    error = prior_report.feature_error(poses, angles, condition, character())
    assert max(dataclasses.astuple(error)) < 1e-4
    bent = angles.at[:, character().joint("spine_low_flex")].add(0.3)
    error = prior_report.feature_error(poses, bent, condition, character())
    assert 0.1 < error.front_angle_rad < 0.3
