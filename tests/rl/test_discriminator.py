from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from getup_jax.config import DiscriminatorConfig
from getup_jax.rl.discriminator import Discriminator, Pairs, gradient_penalty, hinge_loss, reward

CONFIG = DiscriminatorConfig(
    gru_size=16, hidden_sizes=(16,), heads=4, learning_rate=3e-3, minibatch_size=64
)
N, F, D = 256, 3, 5


def test_reward_clips_every_head_before_the_mean():
    output = jnp.asarray([[3.0, -1.0], [0.5, -0.25], [-9.0, -7.0]])
    assert_allclose(reward(output), [0.0, 0.125, -1.0])


def test_hinge_loss_of_a_worked_example():
    fake = jnp.asarray([[-2.0, 0.5]])  # max(0, 1 + D): 0 and 1.5
    real = jnp.asarray([[1.0, -1.0]])  # max(0, 1 - D): 0 and 2
    assert_allclose(hinge_loss(fake, real), 0.75 + 1.0)


def test_hinge_loss_of_a_perfect_ensemble_is_zero():
    assert hinge_loss(jnp.full((3, 2), -1.0), jnp.full((3, 2), 1.5)) == 0.0


def test_penalty_of_a_linear_ensemble():
    """Heads a.x and b.x: the gradient of their sum is a + b everywhere."""
    rng = np.random.default_rng(0)
    heads = jnp.asarray(rng.normal(size=(F * D, 2)), jnp.float32)
    pairs = Pairs(
        fake=jnp.asarray(rng.normal(size=(7, F, D)), jnp.float32),
        real=jnp.asarray(rng.normal(size=(7, F, D)), jnp.float32),
        share=jnp.linspace(0.0, 1.0, 7),
        head=jnp.asarray([0, 1, 0, 1, 0, 1, 0], jnp.int32),
    )
    found = gradient_penalty(lambda x: x.reshape(len(x), -1) @ heads, pairs)
    norm = np.linalg.norm(np.asarray(heads, np.float64).sum(axis=1))
    assert_allclose(found, (norm - 1.0) ** 2, rtol=1e-5)
    # of each head: four mixtures are judged by the first, three by the second
    found = gradient_penalty(lambda x: x.reshape(len(x), -1) @ heads, pairs, each=True)
    first, second = (np.linalg.norm(np.asarray(heads, np.float64), axis=0) - 1.0) ** 2
    assert_allclose(found, (4 * first + 3 * second) / 7, rtol=1e-5)
    # held at a quarter, gradients are four times as far up
    found = gradient_penalty(lambda x: x.reshape(len(x), -1) @ heads, pairs, norm=0.25)
    assert_allclose(found, (4.0 * norm - 1.0) ** 2, rtol=1e-5)


def test_a_share_of_the_mixtures_gives_the_same_penalty_for_less():
    """It is that of the first rows, which are shuffled; the hinge loss is that of all."""
    rng = np.random.default_rng(1)
    pairs = Pairs(
        fake=jnp.asarray(rng.normal(size=(8, F, D)), jnp.float32),
        real=jnp.asarray(rng.normal(size=(8, F, D)), jnp.float32),
        share=jnp.linspace(0.0, 1.0, 8),
        head=jnp.arange(8, dtype=jnp.int32),
    )
    config = dataclasses.replace(CONFIG, penalty_of="head", penalty_share=0.25)
    discriminator = Discriminator(config)
    variables = discriminator.init(jax.random.PRNGKey(0), F, D).variables
    _, found = discriminator._loss(variables, pairs)
    two = jax.tree.map(lambda x: x[:2], pairs)
    _, of_two = Discriminator(dataclasses.replace(config, penalty_share=1.0))._loss(variables, two)
    _, of_all = Discriminator(dataclasses.replace(config, penalty_share=1.0))._loss(
        variables, pairs
    )
    assert_allclose(found["penalty"], of_two["penalty"], rtol=1e-5)
    assert found["penalty"] != of_all["penalty"]
    assert_allclose(found["real"], of_all["real"], rtol=1e-5)


def test_penalty_is_taken_between_the_windows():
    """Of |x|^2 / 2 the gradient is x itself, so the penalty tells where it was taken."""
    fake, real = jnp.full((1, F, D), 2.0), jnp.zeros((1, F, D))
    pairs = Pairs(fake, real, jnp.asarray([0.25]), jnp.zeros(1, jnp.int32))
    found = gradient_penalty(lambda x: 0.5 * jnp.sum(x**2, axis=(1, 2))[:, None], pairs)
    assert_allclose(found, (0.5 * np.sqrt(F * D) - 1.0) ** 2, rtol=1e-5)


@pytest.fixture(scope="module")
def trained():
    model = Discriminator(CONFIG)
    state = model.init(jax.random.key(0), F, D)
    update = jax.jit(model.update)
    for step in range(30):
        key_fake, key_real, key = jax.random.split(jax.random.key(step), 3)
        fake = 5.0 + 2.0 * jax.random.normal(key_fake, (N, F, D))
        real = 9.0 + 2.0 * jax.random.normal(key_real, (N, F, D))
        state, metrics = update(state, fake, real, key)
    return model, state, metrics


def test_learns_to_tell_two_kinds_apart(trained):
    model, state, metrics = trained
    noise = 2.0 * jax.random.normal(jax.random.key(99), (N, F, D))
    score = jax.jit(model.score)
    real, fake = score(state, 9.0 + noise), score(state, 5.0 + noise)
    assert real.shape == (N,)
    assert float(real.mean()) > 0.3
    assert float(fake.mean()) < -0.3
    assert float(metrics["loss"]) < 1.5


def test_statistics_are_those_of_both_kinds(trained):
    _, state, _ = trained
    assert_allclose(state.statistics.mean, 7.0, atol=0.1)
    # two kinds 4 apart with a spread of 2: 2^2 + 2^2
    assert_allclose(state.statistics.variance, 8.0, rtol=0.05)
    assert float(state.statistics.count) == 30 * 2 * N * F
