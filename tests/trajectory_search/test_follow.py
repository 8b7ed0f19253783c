"""The search that follows curves: what it keeps, and that it is nearer than the policy alone."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from compiled import first_policy
from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.envs.getup.drawn_curves import Curve, style_curve
from getup_jax.evaluation.control_gain import edit_plan
from getup_jax.motion.getup.curve_alignment import FEATURE_SCALE
from getup_jax.rl.learner import make_learner
from getup_jax.trajectory_search import follow
from getup_jax.trajectory_search.follow import PARENTS, WINDOW, Follower, Search, Steps, bound


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(follow, "CHILDREN", 96)  # a third of them with noise
    monkeypatch.setattr(follow, "AHEAD", 6)


@pytest.fixture
def follower(built) -> Follower:
    size = built.environment.action_size
    return Follower(built.environment, lambda seen: jnp.zeros((len(seen), size)))


def begin(built, follower):
    style = jnp.zeros(PARENTS, int)
    return follower.start(built.world, style, style, style_curve(built.world, style))


def test_a_window_leads_on_from_parents_by_its_own_steps(built, follower):
    population = begin(built, follower)
    after, parent, steps = jax.jit(follower.window)(built.world, population, jax.random.PRNGKey(0))
    assert steps.features.shape == (WINDOW, PARENTS, 3)
    assert (np.asarray(parent) < PARENTS).all()
    assert np.bincount(parent, minlength=PARENTS).max() <= 4
    dt = built.environment.engine.control_dt
    np.testing.assert_allclose(after.state.time, WINDOW * dt, rtol=1e-5)
    np.testing.assert_allclose(steps.time[:, 0], dt * np.arange(1, WINDOW + 1), rtol=1e-5)
    value = built.environment.observer.posture(
        after.state.physics.kinematics, built.world.terrain
    ).features
    np.testing.assert_allclose(value, steps.features[-1], atol=1e-6)
    assert (np.diff(np.asarray(after.score)) >= 0).all()  # the fittest first


def test_the_way_to_one_of_the_last_goes_back_through_its_parents():
    def window(first: float, parents: list[int]):
        value = jnp.asarray([[first, first + 1, first + 2]])
        return np.array(parents), Steps(np.asarray(value)[..., None], None, np.asarray(value))

    history = [window(0.0, [0, 1, 2]), window(10.0, [2, 0, 0]), window(20.0, [1, 1, 0])]
    way = follow._way_to(0, history)
    # 20 came from number 1 of the second window, which came from number 0 of the first one
    np.testing.assert_array_equal(way.time, [0.0, 11.0, 20.0])
    np.testing.assert_array_equal(follow._way_to(2, history).time, [2.0, 10.0, 22.0])


@pytest.mark.slow
def test_the_search_follows_a_curve_more_closely_than_a_policy_that_knows_nothing(built):
    size = built.environment.action_size

    def idle(seen: jax.Array) -> jax.Array:
        return jnp.zeros((len(seen), size))

    # half sitting up
    lying = built.world.points[0, 0]
    points = lying + jnp.linspace(0.0, 1.0, 9)[:, None] * jnp.asarray([0.2, 0.0, 0.6])
    curve = Curve(points=points, duration=jnp.asarray(1.0))
    found = Search(built, idle).follow(0, 0, curve, jax.random.PRNGKey(0))
    dt = built.environment.engine.control_dt
    np.testing.assert_allclose(found.time, dt * np.arange(1, len(found.time) + 1), rtol=1e-5)
    assert found.time[-1] >= float(curve.duration) + 0.5 - 1e-5
    zero = jnp.zeros(1, int)
    followed = jax.tree.map(lambda x: x[None], curve)
    state, alone = built.environment.start(built.world, zero, zero, zero, followed), []
    advance = jax.jit(built.environment.advance)
    for _ in range(len(found.time)):
        state, _ = advance(built.world, state, idle(zero))
        alone.append(
            built.environment.observer.posture(
                state.physics.kinematics, built.world.terrain
            ).features[0]
        )
    missed = [
        (np.abs(np.asarray(x) - found.target) / FEATURE_SCALE).sum(axis=1).mean()
        for x in (found.features, alone)
    ]
    assert missed[0] < 0.7 * missed[1]


@pytest.mark.slow
def test_the_bound_of_edits(built):
    network = NetworkConfig(hidden_sizes=(8,))
    learner = make_learner(built.environment, network, PPOConfig(), total_steps=1000)
    policy = first_policy(learner)
    seen: list[float] = []
    found = bound(built, learner, policy, edit_plan(built, 1, seed=0), seen.append)
    assert seen == [1, 2, 3, 4]
    assert (found.edits, found.curves) == (1, 2)
    # it gets nobody up, and so says nothing
    assert found.success == 0.0
    assert np.isnan([row.gain for row in found.features.values()]).all()


def test_the_bound_is_of_edits_for_which_it_got_up(built, monkeypatch):
    steps = iter([(1.0, 0.0), (1.0, 0.3), (1.0, 0.0), (0.5, 0.9)])

    def follow_exactly(self, getup, row, curve, key):
        """Follows half of the change, and stands at a share of the end, the first of the pair."""
        share, moved = next(steps)
        time = np.arange(1.0, 41.0) / 40
        target = np.tile([1.4, 1.5, 1.5], (40, 1)) + moved * np.sin(9 * time)[:, None]
        features = target - 0.5 * (target - [1.4, 1.5, 1.5])
        features[-1, 0] = share * target[-1, 0]
        return Steps(features, target, time)

    monkeypatch.setattr(Search, "follow", follow_exactly)
    plan = edit_plan(built, 1, seed=0)
    found = bound(built, None, None, plan, lambda done: None)
    assert found.success == 0.5
    for row in found.features.values():
        assert row.gain == pytest.approx(0.5, abs=0.02)
        assert row.asked_rms < 0.3
