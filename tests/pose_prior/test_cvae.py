import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.pose_prior.cvae import (
    CVAE,
    MIN_STD,
    init_variables,
    kl_to_standard_normal,
    loss_terms,
)

JOINTS, LATENT, ROWS = 5, 3, 8


def arrays(rows: int = ROWS) -> tuple[jax.Array, jax.Array]:
    """Angles and conditions with other means and scales than a standard normal."""
    rng = np.random.default_rng(0)
    angles = 0.4 + 0.2 * rng.normal(size=(rows, JOINTS))
    condition = np.array([1.0, 1.5, 1.6]) + 0.3 * rng.normal(size=(rows, 3))
    return jnp.asarray(angles, jnp.float32), jnp.asarray(condition, jnp.float32)


@functools.cache
def make(conditional: bool = True):
    model = CVAE(JOINTS, LATENT, (16, 16), conditional)
    return model, init_variables(model, jax.random.key(0), *arrays())


def test_kl_is_the_closed_form():
    # mean 1, variance 4: (1 + 4 - ln 4 - 1) / 2; mean 0, variance 1: 0
    mean, log_variance = jnp.array([[1.0, 0.0]]), jnp.log(jnp.array([[4.0, 1.0]]))
    expected = 0.5 * (1 + 4 - np.log(4) - 1)
    np.testing.assert_allclose(kl_to_standard_normal(mean, log_variance), [expected], rtol=1e-6)


def test_kl_is_the_integral_of_the_log_ratio():
    mean, variance = 0.7, 0.3
    x = np.linspace(-8, 8, 20001)
    density = np.exp(-((x - mean) ** 2) / (2 * variance)) / np.sqrt(2 * np.pi * variance)
    log_ratio = -((x - mean) ** 2) / (2 * variance) - 0.5 * np.log(variance) + x**2 / 2
    expected = np.sum(density * log_ratio) * (x[1] - x[0])
    got = kl_to_standard_normal(jnp.array([mean]), jnp.log(jnp.array([variance])))
    np.testing.assert_allclose(got, expected, rtol=1e-5)


def test_shapes_keep_leading_axes():
    model, variables = make()
    angles, condition = (jnp.stack([x, x]) for x in arrays())
    noise = jnp.zeros((2, ROWS, LATENT))
    decoded, mean, log_variance = model.apply(variables, angles, condition, noise)
    assert decoded.shape == (2, ROWS, JOINTS)
    assert mean.shape == log_variance.shape == (2, ROWS, LATENT)


def test_noise_moves_the_latent_by_its_standard_deviation():
    model, variables = make()
    batch = arrays()
    noise = jnp.ones((ROWS, LATENT))
    decoded, mean, log_variance = model.apply(variables, *batch, noise)
    latent = mean + jnp.sqrt(jnp.exp(log_variance))
    expected = model.apply(variables, latent, batch[1], method="decode")
    np.testing.assert_allclose(decoded, expected, atol=1e-6)


def test_blur_reaches_the_encoder_and_not_what_is_to_be_decoded():
    model, variables = make()
    angles, condition = arrays()
    blur, noise = jnp.full_like(angles, 0.1), jnp.zeros((ROWS, LATENT))
    terms = loss_terms(model, variables, (angles, condition), noise, 1.0, blur)
    decoded, mean, log_variance = model.apply(variables, angles + blur, condition, noise)
    np.testing.assert_allclose(
        terms["reconstruction"], jnp.mean((decoded - angles) ** 2), rtol=1e-5
    )
    np.testing.assert_allclose(
        terms["kl"], jnp.sum(kl_to_standard_normal(mean, log_variance)), rtol=1e-5
    )


def test_reconstruction_is_averaged_in_squared_radians():
    model, variables = make()
    angles, condition = arrays()
    decoded, _, _ = model.apply(variables, angles, condition, jnp.zeros((ROWS, LATENT)))
    terms = loss_terms(model, variables, (angles, condition), jnp.zeros((ROWS, LATENT)), 1e-6)
    expected = np.mean((np.asarray(decoded) - np.asarray(angles)) ** 2)
    np.testing.assert_allclose(terms["reconstruction"], expected, rtol=1e-6)


def test_kl_is_summed_over_the_batch():
    model, variables = make()
    batch, noise = arrays(), jnp.zeros((ROWS, LATENT))
    twice = tuple(jnp.concatenate([x, x]) for x in batch)
    one = loss_terms(model, variables, batch, noise, 0.1)
    two = loss_terms(model, variables, twice, jnp.concatenate([noise, noise]), 0.1)
    np.testing.assert_allclose(two["kl"], 2 * one["kl"], rtol=1e-6)
    np.testing.assert_allclose(two["reconstruction"], one["reconstruction"], rtol=1e-6)
    _, mean, log_variance = model.apply(variables, *batch, noise)
    expected = 0.1 * np.sum(kl_to_standard_normal(mean, log_variance))
    np.testing.assert_allclose(one["kl"], expected, rtol=1e-6)


def test_statistics_are_the_training_sets():
    angles, condition = arrays()
    angles = angles.at[:, 0].set(0.25)  # a hinge that never moves
    model, _ = make()
    statistics = init_variables(model, jax.random.key(0), angles, condition)["statistics"]
    np.testing.assert_allclose(statistics["angle_mean"], np.mean(angles, 0), rtol=1e-5)
    np.testing.assert_allclose(statistics["angle_std"][1:], np.std(angles, 0)[1:], rtol=1e-5)
    assert statistics["angle_std"][0] == np.float32(MIN_STD)
    np.testing.assert_allclose(statistics["condition_std"], np.std(condition, 0), rtol=1e-5)


def test_units_do_not_matter_to_the_networks():
    # The same poses in units ten times as fine: equal latents, decoded angles ten times as large.
    model, variables = make()
    angles, condition = arrays()
    fine = init_variables(model, jax.random.key(0), 10 * angles, 10 * condition)
    mean, _ = model.apply(variables, angles, condition, method="encode")
    fine_mean, _ = model.apply(fine, 10 * angles, 10 * condition, method="encode")
    np.testing.assert_allclose(fine_mean, mean, atol=1e-5)
    decoded = model.apply(variables, mean, condition, method="decode")
    fine_decoded = model.apply(fine, mean, 10 * condition, method="decode")
    np.testing.assert_allclose(fine_decoded, 10 * decoded, atol=1e-4)


@pytest.mark.parametrize("conditional", [True, False])
def test_only_the_conditional_model_sees_the_condition(conditional):
    model, variables = make(conditional)
    angles, condition = arrays()
    latent = jnp.ones((ROWS, LATENT))
    mean, _ = model.apply(variables, angles, condition, method="encode")
    other_mean, _ = model.apply(variables, angles, condition + 1, method="encode")
    decoded = model.apply(variables, latent, condition, method="decode")
    other = model.apply(variables, latent, condition + 1, method="decode")
    assert bool(jnp.all(mean == other_mean)) is not conditional
    assert bool(jnp.all(decoded == other)) is not conditional
