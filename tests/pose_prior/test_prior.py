import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import serialization
from pose_samples import QUICK, character, manifold_poses, pose_set, quick_prior

from getup_jax.pose_prior import prior as pose_prior
from getup_jax.pose_prior import report as prior_report
from getup_jax.pose_prior.cvae import CVAE
from getup_jax.pose_prior.prior import MIN_LATENT_STD, PosePrior
from getup_jax.pose_prior.training import limit_check, train_prior


def sample(rows: slice = slice(0, 200)) -> tuple[jax.Array, jax.Array]:
    poses = pose_set()
    return jnp.asarray(poses.angles[rows]), jnp.asarray(poses.condition[rows])


def test_a_two_dimensional_manifold_is_learned():
    _, report = quick_prior()
    assert report.heldout_rmse_deg < 3.0
    assert report.heldout_rmse_deg == pytest.approx(report.train_rmse_deg, rel=0.5)
    spread = np.degrees(np.sqrt(np.mean(pose_set().angles.var(axis=0))))
    assert spread > 20  # degrees: what predicting the mean pose would be off


def test_small_sets_get_more_epochs_until_enough_updates():
    _, report = quick_prior()
    per_epoch = report.num_poses // QUICK.batch_size
    assert report.epochs == -(-QUICK.min_updates // per_epoch)
    assert report.updates == report.epochs * per_epoch


def test_decode_inverts_encode():
    prior, _ = quick_prior()
    angles, condition = sample()
    decoded = pose_prior.decode(prior, pose_prior.encode(prior, angles, condition), condition)
    assert math.degrees(float(jnp.sqrt(jnp.mean((decoded - angles) ** 2)))) < 3.0


def test_the_action_of_a_pose_decodes_like_its_latent():
    prior, _ = quick_prior()
    angles, condition = sample()
    action = pose_prior.encode_action(prior, angles, condition)
    latent = pose_prior.encode(prior, angles, condition)
    np.testing.assert_allclose(
        pose_prior.decode_action(prior, action, condition),
        pose_prior.decode(prior, latent, condition),
        atol=1e-5,
    )


def test_actions_of_the_training_poses_are_standardised():
    prior, _ = quick_prior()
    action = np.asarray(pose_prior.encode_action(prior, *sample(slice(None))))
    active = np.asarray(prior.latent_std) > MIN_LATENT_STD
    assert active.any()
    # Not exactly: a tenth of these rows was held out.
    np.testing.assert_allclose(action[:, active].mean(0), 0, atol=0.15)
    np.testing.assert_allclose(action[:, active].std(0), 1, atol=0.15)


def test_a_collapsed_latent_does_not_blow_up():
    # A KL term so strong that every dimension collapses.
    config = dataclasses.replace(QUICK, beta=1.0, min_updates=100)
    prior, report = train_prior(pose_set(), config)
    assert report.active_latents == 0
    np.testing.assert_array_equal(prior.latent_std, np.float32(MIN_LATENT_STD))
    assert float(jnp.abs(pose_prior.encode_action(prior, *sample())).max()) < 3.0


def test_dict_round_trip_needs_no_shapes():
    prior, _ = quick_prior()
    written = serialization.msgpack_serialize(pose_prior.to_dict(prior))
    restored = pose_prior.from_dict(serialization.msgpack_restore(written))
    angles, condition = sample()
    action = pose_prior.encode_action(prior, angles, condition)
    np.testing.assert_array_equal(
        pose_prior.encode_action(restored, angles, condition), np.asarray(action)
    )
    np.testing.assert_array_equal(
        pose_prior.decode_action(restored, action, condition),
        pose_prior.decode_action(prior, action, condition),
    )
    assert jax.tree.structure(restored) == jax.tree.structure(prior)


def test_a_dict_with_a_missing_part_is_an_error():
    state = pose_prior.to_dict(quick_prior()[0])
    state.pop("latent_std")
    with pytest.raises(ValueError, match="latent_std"):
        pose_prior.from_dict(state)


@pytest.mark.parametrize("model", [CVAE(5, 3, (8, 4)), CVAE(5, 3, (8,), conditional=False)])
def test_the_network_is_read_off_the_variables(model):
    sizes = (jnp.zeros(size) for size in (5, 3, 3))
    shapes = jax.eval_shape(model.init, jax.random.key(0), *sizes)
    variables = jax.tree.map(lambda x: jnp.zeros(x.shape), shapes)
    limit = jnp.ones(5)
    prior = PosePrior(variables, jnp.zeros(3), jnp.ones(3), -limit, limit)
    assert pose_prior.network(prior) == model
    assert pose_prior.network(pose_prior.from_dict(pose_prior.to_dict(prior))) == model


def test_works_as_an_argument_of_jit_and_over_leading_axes():
    prior, _ = quick_prior()
    angles, condition = sample(slice(0, 6))
    latent = pose_prior.encode(prior, angles, condition)
    batched = jax.jit(pose_prior.decode)(
        prior, latent.reshape(2, 3, -1), condition.reshape(2, 3, 3)
    )
    rows = [pose_prior.decode(prior, *row) for row in zip(latent, condition, strict=True)]
    np.testing.assert_allclose(batched.reshape(6, -1), np.stack(rows), atol=1e-5)


def test_limit_check_counts_angles_and_poses():
    prior, _ = quick_prior()
    lower, upper = np.asarray(prior.joint_lower), np.asarray(prior.joint_upper)
    angles = np.tile(0.5 * (lower + upper), (4, 1))
    angles[0, :2] = upper[:2] + 0.2
    checked = limit_check(prior, jnp.asarray(angles))
    assert checked["random_poses_outside"] == 0.25
    assert checked["random_angles_outside"] == pytest.approx(2 / angles.size)
    assert checked["random_worst_deg"] == pytest.approx(np.degrees(0.2), rel=1e-4)


def test_an_evaluation_of_the_quick_prior():
    prior, _ = quick_prior()
    result = prior_report.evaluate_prior(prior, manifold_poses(50), character())
    assert result.num_poses == 50
    assert result.rmse_deg < 3.0
    assert result.feature_error.height_m < 0.05
    assert result.decoded_penetration.share_deep == pytest.approx(
        result.data_penetration.share_deep, abs=0.2
    )
