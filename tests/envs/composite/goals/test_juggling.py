"""Juggling by hand: who holds what, what is thrown, what is lost, and what it earns."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from goal_samples import LINKS, kinematics

from getup_jax.envs.composite.goals.flight import GRAVITY
from getup_jax.envs.composite.goals.juggling import LEFT, NONE, RIGHT, Juggling, JugglingState

KEY = jax.random.key(0)
GOAL = Juggling(1 / 30, left=LINKS.index("hand_l"), right=LINKS.index("hand_r"))
STEP, COMMAND, OBSERVE = jax.jit(GOAL.step), jax.jit(GOAL.command), jax.jit(GOAL.observe)
HANDS = {"hand_l": (0.3, 0.2, 1.0), "hand_r": (0.3, -0.2, 1.0)}
MOTION = {"hand_l": (0.0, 0.1, 3.0), "hand_r": (0.0, 0.0, 1.0)}
UP = (0.3, 0.2, 1.5)  # half a metre above the left hand


def seen(*balls):
    return kinematics(position=HANDS, velocity=MOTION, balls=balls)


def state(frame=1, holder=(LEFT, RIGHT, NONE), catcher=(RIGHT, LEFT, LEFT), leaving=(NONE,) * 3):
    rows = (jnp.asarray([values], jnp.int32) for values in (holder, catcher, leaving))
    return JugglingState(jnp.asarray([frame], jnp.int32), *rows, fresh=jnp.zeros(1, bool))


def test_a_ball_near_its_free_hand_is_caught():
    free = state(holder=(NONE, RIGHT, NONE), catcher=(RIGHT, LEFT, LEFT))
    near = (0.3, 0.2, 1.1)
    after, output = STEP(KEY, free, seen((0.3, 0.2, 2.0), HANDS["hand_r"], near))
    assert after.holder[0].tolist() == [NONE, RIGHT, LEFT]
    assert output.success[0] == 1.0
    assert output.reward[0] == pytest.approx((np.exp(-1.2) + 2.0) / 3, rel=1e-5)  # one flies
    after, output = STEP(KEY, free, seen((0.3, 0.2, 2.0), HANDS["hand_r"], UP))
    assert after.holder[0].tolist() == [NONE, RIGHT, NONE]
    assert np.isnan(output.success[0])


def test_a_hand_that_holds_a_ball_catches_no_other():
    after, _ = STEP(KEY, state(), seen(HANDS["hand_l"], HANDS["hand_r"], HANDS["hand_l"]))
    assert after.holder[0].tolist() == [LEFT, RIGHT, NONE]


def test_a_hand_does_not_catch_what_was_thrown_to_the_other():
    thrown = state(holder=(NONE, NONE, RIGHT), catcher=(RIGHT, RIGHT, LEFT))
    after, _ = STEP(KEY, thrown, seen(HANDS["hand_l"], UP, HANDS["hand_r"]))
    assert after.holder[0].tolist() == [NONE, NONE, RIGHT]


def test_of_two_balls_the_nearer_is_caught():
    both = state(holder=(NONE, NONE, RIGHT), catcher=(LEFT, LEFT, LEFT))
    after, _ = STEP(KEY, both, seen((0.3, 0.2, 1.05), (0.3, 0.2, 1.01), HANDS["hand_r"]))
    assert after.holder[0].tolist() == [NONE, LEFT, RIGHT]


def test_the_hands_let_go_in_turn_twenty_steps_apart():
    held = seen(HANDS["hand_l"], HANDS["hand_r"], UP)
    released = {}
    for frame in range(1, 41):
        after, _ = STEP(KEY, state(frame=frame - 1), held)
        left = [ball for ball in (0, 1) if after.holder[0, ball] == NONE]
        if left:
            released[frame] = left
            assert after.leaving[0, left[0]] == (LEFT, RIGHT)[left[0]]
            assert after.catcher[0, left[0]] == (RIGHT, LEFT)[left[0]]
    assert released == {10: [0], 20: [1], 30: [0], 40: [1]}


def test_held_and_leaving_balls_move_with_their_hand():
    command = COMMAND(state(), seen(UP, UP, UP))
    assert command.mask[0].tolist() == [True, True, False]
    np.testing.assert_allclose(command.position[0, 0], HANDS["hand_l"], atol=1e-6)
    np.testing.assert_allclose(command.velocity[0, 1], MOTION["hand_r"], atol=1e-6)
    leaving = state(holder=(NONE, RIGHT, NONE), leaving=(LEFT, NONE, NONE))
    command = COMMAND(leaving, seen(UP, UP, UP))
    assert command.mask[0].tolist() == [True, True, False]
    np.testing.assert_allclose(command.velocity[0, 0], MOTION["hand_l"], atol=1e-6)
    after, _ = STEP(KEY, leaving, seen(UP, HANDS["hand_r"], UP))
    assert COMMAND(after, seen(UP, UP, UP)).mask[0].tolist() == [False, True, False]


def test_the_third_ball_starts_towards_the_hand_that_lets_go_first():
    """And that hand is free by then."""
    time = GOAL.first_throw_s
    fall = jnp.asarray([0.0, 0.0, -0.5 * GRAVITY * time**2])
    firsts = set()
    for height in np.linspace(-0.3, 0.3, 7):
        hands = {"hand_l": (0.3, 0.2, 1.0 + height), "hand_r": (0.3, -0.2, 1.0)}
        held = kinematics(
            position=hands, velocity=MOTION, balls=(hands["hand_l"], hands["hand_r"], UP)
        )
        fresh = GOAL.reset(KEY, held)
        command = COMMAND(fresh, held)
        assert command.mask[0].tolist() == [True, True, True]
        there = command.position[0, 2] + command.velocity[0, 2] * time + fall
        catcher = int(fresh.catcher[0, 2])
        own, other = (hands[name] for name in (("hand_l", "hand_r"), ("hand_r", "hand_l"))[catcher])
        np.testing.assert_allclose(command.position[0, 2], other, atol=1e-6)
        np.testing.assert_allclose(there, own, atol=1e-5)
        after, steps = fresh, 0
        while int(after.holder[0, catcher]) == catcher:
            after, _ = STEP(KEY, after, held)
            steps += 1
        assert 1 <= steps <= 10 < time * 30
        assert int(after.holder[0, 1 - catcher]) == 1 - catcher
        assert not after.fresh[0]
        firsts.add(catcher)
    assert firsts == {LEFT, RIGHT}


@pytest.mark.parametrize("step", [0, 4, 9, 10, 13, 19])
def test_it_begins_in_time_with_hands_that_swing(step):
    """Heights of 1 + .1 sin: the left hand rises fastest in the middle of an interval."""
    angle = 2 * np.pi * (step - 10) / 20
    swing, rate = 0.1 * np.sin(angle), 0.1 * 2 * np.pi / (20 / 30) * np.cos(angle)
    now = kinematics(
        position={"hand_l": (0.3, 0.2, 1.0 + swing), "hand_r": (0.3, -0.2, 1.0 - swing)},
        velocity={"hand_l": (0.0, 0.0, rate), "hand_r": (0.0, 0.0, -rate)},
        balls=(UP, UP, UP),
    )
    assert GOAL.reset(KEY, now).frame.tolist() == [step]


def test_it_goes_with_a_body_that_walks():
    walking = kinematics(
        position=HANDS, velocity=MOTION | {"pelvis": (1.2, -0.3, 0.1)}, balls=(UP, UP, UP)
    )
    still, moving = (COMMAND(GOAL.reset(KEY, x), x) for x in (seen(UP, UP, UP), walking))
    change = moving.velocity - still.velocity
    np.testing.assert_allclose(change[0, 2], [1.2, -0.3, 0.0], atol=1e-6)
    np.testing.assert_allclose(change[0, :2], 0.0)


def test_a_ball_near_the_floor_is_lost():
    low = (1.0, 0.0, 0.29)
    _, output = STEP(KEY, state(), seen(HANDS["hand_l"], HANDS["hand_r"], low))
    assert output.terminated[0]
    assert output.success[0] == 0.0
    _, output = STEP(KEY, state(), seen(low, HANDS["hand_r"], UP))  # held: it is in the hand
    assert not output.terminated[0]


def in_flight(*balls, speed=((0, 0, 0),) * 3, pelvis=(0, 0, 0)):
    """The hands, and balls with their velocities."""
    return kinematics(position=HANDS, velocity={"pelvis": pelvis}, balls=balls, ball_velocity=speed)


def test_a_held_ball_earns_one_and_a_flying_one_by_where_it_comes_down():
    free = state(holder=(NONE, RIGHT, NONE), catcher=(RIGHT, LEFT, LEFT))
    # ball 0 falls .5 m beside the right hand; ball 2 onto the left one
    _, output = STEP(KEY, free, in_flight((0.3, -0.7, 2.0), HANDS["hand_r"], UP))
    assert output.reward[0] == pytest.approx((np.exp(-1.5) + 1.0 + 1.0) / 3, rel=1e-5)


def test_a_throw_is_judged_by_its_velocity():
    """Half a second of flight at the hand's height: v T = (0, -.4), and g T / 2 up."""
    thrown = state(holder=(NONE, RIGHT, LEFT), catcher=(RIGHT, LEFT, RIGHT))
    up = GRAVITY / 4
    for sideways, miss in ((-0.8, 0.0), (-0.4, 0.2)):
        seen_now = in_flight(
            HANDS["hand_l"], UP, UP, speed=((0, sideways, up), (0, 0, 0), (0, 0, 0))
        )
        _, output = STEP(KEY, thrown, seen_now)
        assert output.reward[0] == pytest.approx((np.exp(-3 * miss) + 2.0) / 3, rel=1e-4)


def test_a_hand_is_judged_as_if_it_walked_on_with_the_body():
    thrown = state(holder=(NONE, RIGHT, LEFT), catcher=(RIGHT, LEFT, RIGHT))
    speed = ((1.2, -0.8, GRAVITY / 4), (0, 0, 0), (0, 0, 0))
    walking = in_flight(HANDS["hand_l"], UP, UP, speed=speed, pelvis=(1.2, 0.0, 0.3))
    assert STEP(KEY, thrown, walking)[1].reward[0] == pytest.approx(1.0, rel=1e-5)


def test_a_ball_that_stays_below_its_hand_misses_by_its_highest_point():
    thrown = state(holder=(NONE, RIGHT, LEFT), catcher=(RIGHT, LEFT, RIGHT))
    low = (0.3, -0.2, 0.5)
    rises = ((0, 0, np.sqrt(2 * GRAVITY * 0.3)), (0, 0, 0), (0, 0, 0))  # to .8 m
    for speed, miss in ((rises, 0.2), (((0, 0, -1.0), *rises[1:]), 0.5)):
        _, output = STEP(KEY, thrown, in_flight(low, UP, UP, speed=speed))
        assert output.reward[0] == pytest.approx((np.exp(-3 * miss) + 2.0) / 3, rel=1e-4)


def test_observation_has_its_size_and_the_time_to_the_releases():
    observed = np.asarray(OBSERVE(state(frame=4), seen(UP, UP, UP)))
    assert observed.shape == (1, GOAL.observation_size)
    np.testing.assert_allclose(observed[0, 6:9], UP)  # ball 2 from the root, at the origin
    np.testing.assert_allclose(observed[0, 18:24], [1, 0, 0, 1, 0, 0])
    np.testing.assert_allclose(observed[0, 24:], [0.3, 0.8], atol=1e-6)
