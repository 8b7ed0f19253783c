"""Tennis by hand: the ball that comes, what counts as a hit, and what it earns."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from goal_samples import LINKS, kinematics

from getup_jax.envs.composite.goals.flight import GRAVITY, kick, landing, throw
from getup_jax.envs.composite.goals.tennis_swing import TennisState, TennisSwing

KEY = jax.random.key(0)
DT = 1 / 30
GOAL = TennisSwing(DT, hand=LINKS.index("hand_r"))
STEP, RESET, OBSERVE = jax.jit(GOAL.step), jax.jit(GOAL.reset), jax.jit(GOAL.observe)
COMING, TOUCHED, OUT = 0, 1, 2
HAND = {"hand_r": (0.0, -0.5, 1.42)}  # the racket's centre is .42 m below it
RACKET = (0.0, -0.5, 1.0)


def state(stage=COMING, velocity=(-4.0, 0.0, 0.0), time_left=1.0, score=0.0, goal=(9.0, 0.0)):
    return TennisState(
        time_left=jnp.asarray([time_left]),
        fresh=jnp.asarray([False]),
        start=jnp.zeros((1, 3)),
        launch=jnp.zeros((1, 3)),
        goal=jnp.asarray([goal]),
        velocity=jnp.asarray([velocity]),
        stage=jnp.asarray([stage], jnp.int32),
        score=jnp.asarray([score]),
    )


def seen(ball=RACKET, velocity=(0.0, 0.0, 0.0), yaw=0.0):
    return kinematics(position=HAND, balls=(ball,), ball_velocity=(velocity,), yaw=yaw)


def test_flight_by_hand():
    velocity = throw(jnp.zeros(3), jnp.asarray([2.0, 0.0, 0.0]), 1.0)
    np.testing.assert_allclose(velocity, [2.0, 0.0, GRAVITY / 2])
    # from 1 m, level at 3 m/s: sqrt(2 / g) s
    place = landing(jnp.asarray([1.0, 1.0, 1.0]), jnp.asarray([3.0, 0.0, 0.0]))
    np.testing.assert_allclose(place, [1.0 + 3.0 * np.sqrt(2 / GRAVITY), 1.0], rtol=1e-6)
    falling = jnp.asarray([1.0, 0.0, -GRAVITY * 0.1])
    assert kick(jnp.asarray([1.0, 0.0, 0.0]), falling, 0.1) == pytest.approx(0.0, abs=1e-6)


def test_a_ball_comes_from_the_front_to_the_right_of_the_character():
    many = jax.tree.map(lambda x: jnp.repeat(x, 100, axis=0), seen(yaw=np.pi / 2))  # facing +y
    fresh = RESET(KEY, many)
    np.testing.assert_allclose(fresh.start[:, 1], GOAL.from_m, rtol=1e-5)
    time = GOAL.flight_s
    fall = jnp.asarray([0.0, 0.0, -0.5 * GRAVITY * time**2])
    end = np.asarray(fresh.start + fresh.launch * time + fall)
    for axis, bounds in ((0, GOAL.right), (1, GOAL.forward), (2, GOAL.height)):
        assert bounds[0] - 1e-4 <= end[:, axis].min()
        assert end[:, axis].max() <= bounds[1] + 1e-4
    command = GOAL.command(fresh, many)
    assert command.mask.all()
    np.testing.assert_array_equal(command.position[:, 0], fresh.start)


def test_a_ball_in_flight_earns_nothing_and_is_not_touched():
    after, output = STEP(KEY, state(), seen(velocity=(-4.0, 0.0, -GRAVITY * DT)))
    assert (after.stage[0], output.reward[0]) == (COMING, 0.0)
    assert not GOAL.command(after, seen()).mask.any()


def test_a_bounce_far_from_the_racket_is_no_hit():
    after, _ = STEP(KEY, state(), seen(ball=(3.0, 0.0, 0.04), velocity=(-4.0, 0.0, 3.0)))
    assert after.stage[0] == COMING


def test_a_hit_is_scored_one_step_later_and_paid_until_the_next_ball():
    out = seen(velocity=(8.0, 0.0, 5.0))
    touched, output = STEP(KEY, state(), out)
    assert (touched.stage[0], output.reward[0]) == (TOUCHED, 0.0)
    away, output = STEP(KEY, touched, out)
    position, velocity = jnp.asarray([RACKET]), jnp.asarray([[8.0, 0.0, 5.0]])
    expected = GOAL.score(position, velocity, touched.goal)
    assert away.stage[0] == OUT
    assert output.reward[0] == pytest.approx(float(expected[0]))
    _, output = STEP(KEY, away, seen(ball=(5.0, 0.0, 0.1)))  # whatever it does now
    assert output.reward[0] == pytest.approx(float(expected[0]))
    assert not output.terminated[0]


def test_score_by_hand():
    # thrown from 1 m to the goal in 1 s: 9 m/s along the floor, faster than 10 m/s all in all
    position, goal = jnp.asarray([[0.0, 0.0, 1.0]]), jnp.asarray([[9.0, 0.0]])
    velocity = throw(position, jnp.asarray([[9.0, 0.0, 0.0]]), 1.0)
    assert np.linalg.norm(velocity) < 10.0
    lack = 1 - np.linalg.norm(velocity) / 10.0
    score = float(GOAL.score(position, velocity, goal)[0])
    assert score == pytest.approx(np.exp(-3 * lack**2), rel=1e-5)
    aside = goal + jnp.asarray([0.0, GOAL.spread_m])
    assert float(GOAL.score(position, velocity, aside)[0]) == pytest.approx(score / np.e, rel=1e-5)
    assert float(GOAL.score(position, -velocity, goal)[0]) < 0.02  # the wrong way


def test_the_next_ball_tells_whether_this_one_was_hit():
    over, output = STEP(KEY, state(stage=OUT, time_left=DT / 2, score=0.7), seen())
    assert (output.success[0], output.reward[0]) == (1.0, pytest.approx(0.7))
    assert (over.stage[0], over.score[0]) == (COMING, 0.0)
    assert over.fresh[0]
    _, output = STEP(KEY, state(time_left=DT / 2), seen(velocity=(-4.0, 0.0, -GRAVITY * DT)))
    assert output.success[0] == 0.0
    _, output = STEP(KEY, state(), seen())
    assert np.isnan(output.success[0])


def test_observation_of_a_fresh_ball_is_where_it_will_start():
    fresh = dataclasses.replace(RESET(KEY, seen()))
    observed = np.asarray(OBSERVE(fresh, seen()))[0]
    assert observed.shape == (GOAL.observation_size,)
    np.testing.assert_allclose(observed[:3], fresh.start[0], atol=1e-6)
    np.testing.assert_allclose(observed[3:6], fresh.launch[0], atol=1e-6)
    np.testing.assert_allclose(observed[6:8], fresh.goal[0] / 10, atol=1e-6)
    assert observed[9] == 1.0
