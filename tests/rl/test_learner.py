from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.rl.actor_critic import normalized
from getup_jax.rl.advantages import estimate, next_values
from getup_jax.rl.learner import Learner, make_learner
from getup_jax.rl.minibatch import adapt_scale, first_scale
from getup_jax.rl.policy_update import COSINE_EVERY
from getup_jax.rl.state import TrainState
from probes import Probe, make_world

NETWORK = NetworkConfig(hidden_sizes=(16,), activation="tanh")
CONFIG = PPOConfig(
    num_envs=16,
    num_steps=8,
    epochs=4,
    minibatch_size=32,
    discount=0.8,
    learning_rate=(1e-2, 2e-3),
    critic_learning_rate=(1e-2, 2e-3),
    action_std=(0.4, 0.2),
    stages=2,
)
TOTAL_STEPS = 80 * 16 * 8
SIGNS = jnp.asarray([[0.0, 1.0], [0.0, -1.0]])


class Run:
    """A learner, its compiled iteration, and how often that was traced."""

    def __init__(self, learner: Learner):
        self.learner = learner
        self.traces = 0
        self.initial = jax.jit(learner.init)
        self.iteration = jax.jit(self._counted, donate_argnums=1)

    def _counted(self, world, state):
        self.traces += 1
        return self.learner.iteration(world, state)

    def train(self, world, iterations: int = 80, seed: int = 0):
        state = self.initial(world, jax.random.key(seed))
        for _ in range(iterations):
            state, metrics = self.iteration(world, state)
        return state, metrics


@pytest.fixture(scope="module")
def run() -> Run:
    return Run(make_learner(Probe(), NETWORK, CONFIG, TOTAL_STEPS))


@pytest.fixture(scope="module")
def popart_run() -> Run:
    config = dataclasses.replace(CONFIG, popart=True, target_clip_fraction=0.1)
    env = Probe(scale=(1.0, 1000.0))
    return Run(make_learner(env, NETWORK, config, TOTAL_STEPS))


def _values(run: Run, state: TrainState, observation=SIGNS) -> np.ndarray:
    return np.asarray(run.learner.value(state.learner, jnp.asarray(observation)))[:, 0]


def _actions(run: Run, state: TrainState) -> np.ndarray:
    return np.asarray(run.learner.act(state.learner.policy, SIGNS))[:, 0]


def _is_key(x: jax.Array) -> bool:
    return jnp.issubdtype(x.dtype, jax.dtypes.prng_key)


# ---- learning probes with known answers


def test_value_of_a_constant_reward(run: Run):
    state, metrics = run.train(make_world(constant=1.0))
    assert_allclose(_values(run, state), 1.0, atol=0.05)
    assert float(metrics["loss/value"]) < 1e-2


def test_value_of_a_reward_that_is_observed(run: Run):
    state, metrics = run.train(make_world(by_sign=1.0))
    assert_allclose(_values(run, state), [1.0, -1.0], atol=0.1)
    assert float(metrics["ppo/explained_variance"]) > 0.95


def test_value_of_a_delayed_reward_is_discounted(run: Run):
    state, _ = run.train(make_world(length=2, at_last=1.0, shows_step=1.0))
    steps = [[0.0, 1.0], [0.0, -1.0], [1.0, 1.0], [1.0, -1.0]]
    assert_allclose(_values(run, state, steps), [0.8, 0.8, 1.0, 1.0], atol=0.1)


def test_policy_finds_the_rewarded_action(run: Run):
    state, metrics = run.train(make_world(by_action=1.0, action_mean=0.5))
    assert_allclose(_actions(run, state), 0.5, atol=0.1)
    # All that is left to lose is the exploration's variance.
    assert_allclose(metrics["rollout/reward"], -(0.2**2), atol=0.03)


def test_policy_finds_the_action_for_what_it_sees(run: Run):
    state, _ = run.train(make_world(by_action=1.0, action_mean=0.1, action_by_sign=0.5))
    assert_allclose(_actions(run, state), [0.6, -0.4], atol=0.12)


def test_truncation_bootstraps_and_termination_does_not(run: Run):
    truncated, metrics = run.train(make_world(length=4, truncates=True, constant=1.0))
    assert_allclose(_values(run, truncated), 1.0 / (1.0 - 0.8), rtol=0.05)
    assert float(metrics["episode/terminated_share"]) == 0.0
    terminated, metrics = run.train(make_world(length=4, constant=1.0))
    # The step's number is hidden, so the value is the mean return over the four steps.
    returns = np.cumsum(0.8 ** np.arange(4))
    assert_allclose(_values(run, terminated), returns.mean(), rtol=0.07)
    assert float(metrics["episode/terminated_share"]) == 1.0


def test_popart_learns_values_of_any_scale(popart_run: Run):
    world = make_world(by_sign=1.0, constant=2.0)
    state, metrics = popart_run.train(world, iterations=60)
    values = np.asarray(popart_run.learner.value(state.learner, SIGNS))
    assert_allclose(values, [[3.0, 3000.0], [1.0, 1000.0]], rtol=0.1)
    assert_allclose(state.learner.popart.mean, [2.0, 2000.0], rtol=0.05)
    assert float(metrics["ppo/explained_variance"]) > 0.9


# ---- the state and its step


def test_one_compilation_for_the_run(run: Run, popart_run: Run):
    for each in (run, popart_run):
        before = each.traces
        each.train(make_world(constant=1.0), iterations=3)
        each.train(make_world(by_sign=0.5, length=3), iterations=2, seed=1)
        assert each.traces == max(before, 1) == 1
        assert each.iteration._cache_size() == 1


def test_state_keeps_its_types(run: Run):
    world = make_world(constant=1.0)
    state = jax.eval_shape(run.learner.init, world, jax.random.key(0))
    after, _ = jax.eval_shape(run.learner.iteration, world, state)
    assert jax.tree.structure(after) == jax.tree.structure(state)
    for old, new in zip(jax.tree.leaves(state), jax.tree.leaves(after), strict=True):
        assert (old.shape, old.dtype) == (new.shape, new.dtype)
        assert not old.weak_type
        assert not new.weak_type


def test_metrics_are_float32_scalars(run: Run):
    _, metrics = run.train(make_world(constant=1.0, length=4), iterations=1)
    assert all(x.shape == () and x.dtype == jnp.float32 for x in metrics.values())
    ppo = ("clip_fraction", "kl", "explained_variance", "learning_rate", "action_std")
    norms = ("gradient_norm", "critic_gradient_norm", "gradient_cosine")
    expected = {f"ppo/{name}" for name in (*ppo, *norms)}
    expected |= {"loss/policy", "loss/value", "rollout/reward"}
    expected |= {f"episode/{name}" for name in ("steps", "plus", "count", "terminated_share")}
    assert set(metrics) == expected
    assert float(metrics["episode/count"]) == 16 * 8 / 4
    assert float(metrics["episode/steps"]) == 4.0


def test_a_resumed_run_repeats_the_unbroken_one(run: Run):
    world = make_world(by_action=1.0, action_mean=0.5, length=3)
    unbroken, _ = run.train(world, iterations=5)
    state, _ = run.train(world, iterations=2)
    keys = jax.tree.map(_is_key, state)
    saved = jax.tree.map(lambda x, k: np.asarray(jax.random.key_data(x) if k else x), state, keys)
    state = jax.tree.map(
        lambda x, k: jax.random.wrap_key_data(x) if k else jnp.asarray(x), saved, keys
    )
    for _ in range(3):
        state, _ = run.iteration(world, state)
    assert int(state.iteration) == 5
    for one, other in zip(jax.tree.leaves(unbroken), jax.tree.leaves(state), strict=True):
        assert bool((one == other).all())


def test_the_iteration_number_seeds_its_noise(run: Run):
    world = make_world(by_action=1.0)
    actors = []
    for iteration in (0, 0, 1):
        state, _ = run.train(world, iterations=1)  # the first one only collects statistics
        state = dataclasses.replace(state, iteration=jnp.int32(iteration))
        state, _ = run.iteration(world, state)
        actors.append(np.asarray(state.learner.policy.actor["params"]["output"]["kernel"]))
    assert_array_equal(actors[0], actors[1])
    assert np.abs(actors[0] - actors[2]).max() > 1e-4


def test_the_first_iteration_only_collects_statistics(run: Run):
    world = make_world(by_action=1.0)
    initial = run.initial(world, jax.random.key(0))
    actor = np.asarray(initial.learner.policy.actor["params"]["output"]["kernel"])
    first, _ = run.train(world, iterations=1)
    second, _ = run.train(world, iterations=2)
    assert_array_equal(first.learner.policy.actor["params"]["output"]["kernel"], actor)
    assert float(first.learner.policy.statistics.count) == 16 * 8
    assert np.abs(second.learner.policy.actor["params"]["output"]["kernel"] - actor).max() > 1e-4


def test_statistics_take_in_every_observation_once(run: Run):
    # The step's number takes 0, 1, 2, 3 equally often.
    world = make_world(length=4, shows_step=1.0)
    state, _ = run.train(world, iterations=3)
    statistics = state.learner.policy.statistics
    assert float(statistics.count) == 3 * 16 * 8
    assert_allclose(statistics.mean[0], 1.5, rtol=1e-6)
    assert_allclose(statistics.variance[0], 1.25, rtol=1e-5)
    found = normalized(state.learner.policy, jnp.asarray([[1.5, 0.0]]))
    assert_allclose(found[0, 0], 0.0, atol=1e-5)


def test_stages_of_rate_and_noise(run: Run):
    state = run.initial(make_world(), jax.random.key(0))
    scale = jnp.asarray(0.5, jnp.float32)
    state = dataclasses.replace(
        state, learner=dataclasses.replace(state.learner, learning_rate_scale=scale)
    )
    for iteration, rate, std in ((0, 1e-2, 0.4), (39, 1e-2, 0.4), (40, 2e-3, 0.2), (99, 2e-3, 0.2)):
        stage = run.learner.stage(dataclasses.replace(state, iteration=jnp.int32(iteration)))
        assert_allclose(stage.learning_rate, 0.5 * rate, rtol=1e-6)
        assert_allclose(stage.critic_learning_rate, rate, rtol=1e-6)  # it follows no clip fraction
        assert_allclose(stage.action_std, [std], rtol=1e-6)


def test_stages_of_noise_that_the_actor_gives():
    network = dataclasses.replace(NETWORK, initial_std=0.1)
    ppo = dataclasses.replace(CONFIG, std_scale=(1.0, 0.4))
    run = Run(make_learner(Probe(), network, ppo, TOTAL_STEPS))
    state = run.initial(make_world(), jax.random.key(0))
    for iteration, scale in ((0, 1.0), (40, 0.4)):
        stage = run.learner.stage(dataclasses.replace(state, iteration=jnp.int32(iteration)))
        actor, seen = state.learner.policy.actor, jnp.zeros((1, 2))
        _, std = run.learner.model.distribution(actor, seen, stage.action_std)
        _, own = run.learner.model.distribution(actor, seen, jnp.ones(1))
        assert_allclose(std, scale * own, rtol=1e-6)


def test_rate_adapts_only_when_asked(run: Run, popart_run: Run):
    world = make_world(by_action=1.0)
    fixed, _ = run.train(world, iterations=2)
    assert float(fixed.learner.learning_rate_scale) == 1.0
    adapted, metrics = popart_run.train(
        world, iterations=2
    )  # of which the first one learns nothing
    expected = adapt_scale(first_scale(0.1), metrics["ppo/clip_fraction"], 0.1)
    assert float(adapted.learner.learning_rate_scale) == float(expected)


def test_the_critic_learns_first_and_leaves_the_actor_alone():
    config = dataclasses.replace(
        CONFIG, critic_first=3, target_clip_fraction=0.01, normalize_observation=False
    )
    run = Run(make_learner(Probe(), NETWORK, config, TOTAL_STEPS))
    world = make_world(by_action=1.0)
    first = run.initial(world, jax.random.key(0)).learner
    state, _ = run.train(world, iterations=3)
    learner = state.learner
    of_the_actor = ("policy", "average", "actor_optimiser", "learning_rate_scale")
    for name in of_the_actor:
        for before, after in zip(
            jax.tree.leaves(getattr(first, name)),
            jax.tree.leaves(getattr(learner, name)),
            strict=True,
        ):
            assert_array_equal(before, after)
    assert not np.array_equal(_values(run, state), run.learner.value(first, SIGNS)[:, 0])
    actions = _actions(run, state)
    state, _ = run.iteration(world, state)
    assert not np.array_equal(_actions(run, state), actions)


def test_the_average_follows_the_actor(run: Run):
    world = make_world(by_action=1.0, action_mean=0.5)
    state, _ = run.train(world)
    newest, policy = state.learner.policy, state.learner.averaged_policy
    assert policy.statistics is newest.statistics
    kernel, average = (p.actor["params"]["output"]["kernel"] for p in (newest, policy))
    assert not np.array_equal(kernel, average)
    assert_allclose(run.learner.act(policy, SIGNS), 0.5, atol=0.1)


def test_the_gradients_noise_is_measured_now_and_then(run: Run):
    world = make_world(by_action=1.0, action_mean=0.5)
    state = run.initial(world, jax.random.key(0))
    known = []
    for _ in range(COSINE_EVERY + 1):
        state, metrics = run.iteration(world, state)
        known.append(not np.isnan(metrics["ppo/gradient_cosine"]))
    assert known == [True] + [False] * (COSINE_EVERY - 1) + [True]


def test_switched_off_parts_are_none():
    config = dataclasses.replace(CONFIG, normalize_observation=False)
    learner = make_learner(Probe(), NETWORK, config, TOTAL_STEPS)
    state = jax.eval_shape(learner.init_learner, jax.random.key(0))
    assert state.policy.statistics is None
    assert state.popart is None
    assert_array_equal(normalized(state.policy, SIGNS), SIGNS)


def test_weights_are_scaled_and_checked():
    env = Probe(scale=(1.0, 1.0))
    assert make_learner(env, NETWORK, CONFIG, 1).weights == (0.5, 0.5)
    assert make_learner(env, NETWORK, CONFIG, 1, (1.0, 3.0)).weights == (0.25, 0.75)
    with pytest.raises(ValueError, match="expected 2"):
        make_learner(env, NETWORK, CONFIG, 1, (1.0,))


# ---- values of what the steps reached


def test_next_values_are_the_critics_on_the_final_observations(run: Run):
    world = make_world(length=3, truncates=True, shows_step=1.0)
    state = run.initial(world, jax.random.key(5))
    learner, stage = run.learner, run.learner.stage(state)
    transition = learner._collect(world, state, stage, jax.random.key(6)).transition
    assert bool(transition.truncated.any())
    assert not bool(transition.truncated.all())
    value = learner.value(state.learner, transition.observation)
    reached = next_values(learner.model, state.learner, transition, value)
    expected = learner.value(state.learner, transition.final_observation)
    assert_allclose(reached, expected, rtol=1e-5, atol=1e-6)
    assert not np.allclose(reached[:-1], value[1:])  # a new episode's value is another one


def test_the_critics_targets_may_have_a_lambda_of_their_own():
    """Advantages follow `gae_lambda`, targets `critic_lambda`; each as if it were the only one."""
    world = make_world(3, by_sign=1.0, by_action=1.0)

    def samples(gae_lambda: float, critic_lambda: float | None = None):
        config = dataclasses.replace(CONFIG, gae_lambda=gae_lambda, critic_lambda=critic_lambda)
        learner = make_learner(Probe(), NETWORK, config, TOTAL_STEPS)

        def rollout(key: jax.Array):
            state = learner.init(world, key)
            transition = learner.collect(world, state).transition
            return estimate(learner.model, state.learner, transition, config, config.discount)[1]

        return jax.jit(rollout)(jax.random.key(0))

    short, long, both = samples(0.3), samples(0.9), samples(0.3, 0.9)
    assert_allclose(both.advantage, short.advantage, rtol=1e-5, atol=1e-6)
    assert_allclose(both.target, long.target, rtol=1e-5, atol=1e-6)
    assert np.abs(both.target - short.target).max() > 1e-3
