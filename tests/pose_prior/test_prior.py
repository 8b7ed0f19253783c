import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import serialization
from pose_samples import QUICK, pose_set, quick_prior

from getup_jax.pose_prior import prior as pose_prior
from getup_jax.pose_prior.cvae import CVAE
from getup_jax.pose_prior.prior import MIN_LATENT_STD, PosePrior
from getup_jax.pose_prior.training import train_prior


def sample(rows: slice = slice(0, 200)) -> tuple[jax.Array, jax.Array]:
    poses = pose_set()
    return jnp.asarray(poses.angles[rows]), jnp.asarray(poses.condition[rows])


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
