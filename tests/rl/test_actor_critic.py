from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.core.mirror import CURVE, POLAR, QUATERNION, Symmetry, concatenated, signed, vectors
from getup_jax.networks.mlp import MLP
from getup_jax.rl import normalize
from getup_jax.rl.actor_critic import ActorCritic, make_actor_critic, normalized, observe
from getup_jax.rl.state import LearnerState

SYMMETRY = Symmetry(
    observation=concatenated([vectors([1, 0], signed(POLAR)), CURVE, signed(QUATERNION)]),
    action=vectors([1, 0], signed([1.0, -1.0])),
)
NETWORK = NetworkConfig(hidden_sizes=(32, 16))
TOLERANCE = {"rtol": 1e-5, "atol": 1e-5}


@dataclasses.dataclass(frozen=True)
class Env:
    """The sizes of an environment, and its mirror image."""

    symmetry: Symmetry | None = SYMMETRY
    observation_size: int = SYMMETRY.observation.size
    action_size: int = SYMMETRY.action.size
    num_objectives: int = 2


def observations(seed: int = 0) -> jax.Array:
    rng = np.random.default_rng(seed)
    return jnp.asarray(3.0 * rng.normal(size=(20, Env.observation_size)) + 0.5, jnp.float32)


def make(
    network: NetworkConfig = NETWORK, normalize_observation: bool = True, env: Env = Env()
) -> tuple[ActorCritic, LearnerState]:
    """Fresh networks that have seen some observations, with an actor that is not near zero."""
    config = PPOConfig(normalize_observation=normalize_observation)
    model = make_actor_critic(env, network, normalize_observation)
    learner = model.init(jax.random.PRNGKey(0), config)
    policy = observe(learner.policy, observations(1), model.symmetry)
    actor = jax.tree.map(
        lambda x: x + 0.1 * jnp.cos(jnp.arange(x.size)).reshape(x.shape), policy.actor
    )
    return model, dataclasses.replace(learner, policy=dataclasses.replace(policy, actor=actor))


def both(normalize_observation: bool = True, network: NetworkConfig = NETWORK):
    """The distribution and the value of observations, and of their images."""
    model, learner = make(network, normalize_observation)
    raw = observations()
    found = []
    for x in (raw, SYMMETRY.observation(raw)):
        seen = normalized(learner.policy, x)
        mean, std = model.distribution(learner.policy.actor, seen, jnp.ones(Env.action_size))
        found.append((mean, jnp.broadcast_to(std, mean.shape), model.value(learner, seen)))
    return found


@pytest.mark.parametrize("normalize_observation", [True, False])
@pytest.mark.parametrize("initial_std", [None, 0.3])
def test_actor_and_critic_are_equivariant(normalize_observation, initial_std):
    network = dataclasses.replace(NETWORK, initial_std=initial_std)
    (mean, std, value), image = both(normalize_observation, network)
    assert np.abs(mean).max() > 0.1
    assert not np.allclose(image[0], mean, atol=0.01)
    np.testing.assert_allclose(image[0], SYMMETRY.action(mean), **TOLERANCE)
    np.testing.assert_allclose(image[1], SYMMETRY.action.unsigned()(std), **TOLERANCE)
    np.testing.assert_allclose(image[2], value, **TOLERANCE)
    if initial_std is not None:
        assert np.ptp(std, axis=1).max() > 0.01  # a std for each action


def test_without_the_setting_or_the_symmetry_the_networks_are_plain():
    plain = dataclasses.replace(NETWORK, mirror=False)
    for model, learner in (make(plain), make(env=Env(symmetry=None))):
        assert model.symmetry is None
        assert isinstance(model.actor, MLP)
        assert isinstance(model.critic, MLP)
        seen = observations()
        expected = model.actor.apply(learner.policy.actor, seen)
        np.testing.assert_array_equal(model.mean(learner.policy.actor, seen), expected)


def test_normalised_observations_are_mirrored_without_offset():
    _, learner = make()
    raw = observations()
    seen, image = (normalized(learner.policy, x) for x in (raw, SYMMETRY.observation(raw)))
    np.testing.assert_allclose(image, SYMMETRY.observation.linear()(seen), **TOLERANCE)


def test_statistics_are_those_of_the_observations_and_their_images():
    model, learner = make()
    parts = [observations(seed) for seed in range(1, 6)]
    policy = learner.policy
    for part in parts[1:]:
        policy = observe(policy, part, model.symmetry)
    every = jnp.concatenate(parts)
    every = np.concatenate([every, SYMMETRY.observation(every)])
    np.testing.assert_allclose(policy.statistics.mean, every.mean(axis=0), atol=1e-5)
    np.testing.assert_allclose(policy.statistics.variance, every.var(axis=0), rtol=1e-4)
    assert float(policy.statistics.count) == 100  # images are not samples


def test_a_policy_from_elsewhere_gets_symmetric_statistics():
    model, learner = make(dataclasses.replace(NETWORK, mirror=False))
    mirrored, _ = make()
    assert model.symmetric(learner.policy) is learner.policy
    policy = mirrored.symmetric(learner.policy)
    again = mirrored.symmetric(policy)
    jax.tree.map(
        lambda a, b: np.testing.assert_allclose(a, b, atol=1e-6),
        policy.statistics,
        again.statistics,
    )
    expected = normalize.symmetric(learner.policy.statistics, SYMMETRY.observation)
    np.testing.assert_array_equal(policy.statistics.mean, expected.mean)
    assert not np.allclose(policy.statistics.mean, learner.policy.statistics.mean)


def test_before_any_observation_the_image_of_one_is_its_image_all_the_same():
    model = make_actor_critic(Env(), NETWORK)
    policy = model.init(jax.random.PRNGKey(0), PPOConfig()).policy
    raw = observations()
    seen, image = (normalized(policy, x) for x in (raw, SYMMETRY.observation(raw)))
    np.testing.assert_allclose(image, SYMMETRY.observation.linear()(seen), **TOLERANCE)
