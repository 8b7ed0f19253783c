"""A mirrored prior: equivariant by construction, from the first weights to the cache."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from pose_samples import QUICK, character, manifold_poses

from getup_jax.core import mirror
from getup_jax.physics.mirror_image import joint_mirror
from getup_jax.pose_prior import cache, cvae
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.pose_prior.data import PoseSet, make_pose_set, split
from getup_jax.pose_prior.prior import PosePrior
from getup_jax.pose_prior.training import train_prior

BRIEF = dataclasses.replace(QUICK, min_updates=60)


@pytest.fixture(scope="module")
def poses() -> PoseSet:
    """Of one side alone: no images are among them."""
    return make_pose_set(manifold_poses(200), character())


@pytest.fixture(scope="module", params=[True, False], ids=["conditional", "standard"])
def prior(request, poses) -> PosePrior:
    return train_prior(poses, dataclasses.replace(BRIEF, conditional=request.param))[0]


def test_the_poses_images_have_the_images_latents(prior, poses):
    images, latent = joint_mirror(character()), mirror.latent(prior.latent_size)
    angles, condition = jnp.asarray(poses.angles), jnp.asarray(poses.condition)
    found = pose_prior.encode_action(prior, angles, condition)
    image = pose_prior.encode_action(prior, images(angles), mirror.CURVE(condition))
    np.testing.assert_allclose(image, latent(found), atol=1e-5)
    assert np.abs(image - found).max() > 0.1
    spread = pose_prior.posterior(prior, angles, condition)[1]
    other = pose_prior.posterior(prior, images(angles), mirror.CURVE(condition))[1]
    np.testing.assert_allclose(other, latent.unsigned()(spread), atol=1e-5)


def test_the_latents_images_decode_to_the_images_of_the_pose(prior, poses):
    images, latent = joint_mirror(character()), mirror.latent(prior.latent_size)
    rng = np.random.default_rng(0)
    action = jnp.asarray(rng.normal(size=(len(poses.angles), prior.latent_size)), jnp.float32)
    condition = jnp.asarray(poses.condition)
    found = pose_prior.decode_action(prior, action, condition)
    image = pose_prior.decode_action(prior, latent(action), mirror.CURVE(condition))
    np.testing.assert_allclose(image, images(found), atol=1e-5)
    assert np.abs(image - found).max() > 0.01


def test_the_middle_of_the_latents_is_its_own_image(prior):
    half = prior.latent_size // 2
    assert prior.mirrored
    np.testing.assert_allclose(prior.latent_mean[half:], 0.0, atol=1e-6)
    assert np.abs(prior.latent_mean[:half]).max() > 0


def test_statistics_are_those_of_the_poses_and_their_images(prior, poses):
    rows, _ = split(poses.group, BRIEF.holdout, BRIEF.seed)
    angles, condition = poses.angles[rows], poses.condition[rows]
    both = {
        "angle": np.concatenate([angles, joint_mirror(character())(angles)]),
        "condition": np.concatenate([condition, mirror.CURVE(condition)]),
    }
    statistics = prior.variables["statistics"]
    for name, x in both.items():
        std = np.maximum(x.std(axis=0), cvae.MIN_STD)
        np.testing.assert_allclose(statistics[f"{name}_mean"], x.mean(axis=0), atol=1e-5)
        np.testing.assert_allclose(statistics[f"{name}_std"], std, rtol=1e-4)


def test_a_mirrored_prior_is_read_back_with_its_image(prior):
    again = pose_prior.from_dict(pose_prior.to_dict(prior))
    assert pose_prior.network(again) == pose_prior.network(prior)
    assert again.mirrored
    latent, condition = jnp.ones((3, prior.latent_size)), jnp.ones((3, 3))
    np.testing.assert_array_equal(
        pose_prior.decode(again, latent, condition), pose_prior.decode(prior, latent, condition)
    )


def test_the_setting_switches_it_off_and_other_priors_keep_their_names(poses):
    plain = dataclasses.replace(BRIEF, mirror=False, min_updates=1)
    assert not train_prior(poses, plain)[0].mirrored
    lopsided = dataclasses.replace(poses, mirror=None)  # a body without an image
    assert not train_prior(lopsided, dataclasses.replace(plain, mirror=True))[0].mirrored
    name = cache.fingerprint(poses, plain)
    assert cache.fingerprint(lopsided, plain) == name
    assert cache.fingerprint(lopsided, BRIEF) == cache.fingerprint(
        lopsided, dataclasses.replace(BRIEF, mirror=False)
    )
    assert cache.fingerprint(poses, dataclasses.replace(plain, mirror=True)) != name


def test_a_mirrored_model_needs_the_image():
    model = cvae.CVAE(4, 2, (8,), mirrored=True)
    arrays = jnp.zeros((3, 4)), jnp.zeros((3, 3))
    with pytest.raises(ValueError, match="angle_mirror: expected the hinges' mirror image"):
        cvae.init_variables(model, jnp.zeros(2, jnp.uint32), *arrays)
