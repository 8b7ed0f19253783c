"""Heading, location and aiming: rewards and observations by hand, and how targets change."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from goal_samples import LINKS, kinematics

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.envs.composite.goals import Goals, make_goals
from getup_jax.envs.composite.goals.aiming import Aiming, AimingState
from getup_jax.envs.composite.goals.target_heading import HeadingState, TargetHeading
from getup_jax.envs.composite.goals.target_location import LocationState, TargetLocation
from getup_jax.physics.character import load_character

KEY = jax.random.key(0)
DT = 1 / 30
HEADING = TargetHeading(DT)
LOCATION = TargetLocation(DT)
AIMING = Aiming(DT, forearm=LINKS.index("forearm_r"), hand=LINKS.index("hand_r"))
HEADING_STEP, LOCATION_STEP = jax.jit(HEADING.step), jax.jit(LOCATION.step)
AIMING_STEP = jax.jit(AIMING.step)


def heading_state(direction=(0.0, 1.0), speed=1.5, time_left=2.0):
    return HeadingState(
        direction=jnp.asarray([direction]),
        speed=jnp.asarray([speed]),
        time_left=jnp.asarray([time_left]),
    )


def location_state(place=(4.0, 0.0), time_left=3.0, reached=False):
    return LocationState(
        place=jnp.asarray([place]),
        time_left=jnp.asarray([time_left]),
        reached=jnp.asarray([reached]),
    )


@pytest.mark.parametrize(
    ("velocity", "expected"),
    [
        ((0.0, 1.5, 0.3), 1.0),  # as wanted; the vertical does not count
        ((0.0, 0.0, 0.0), np.exp(-3.0)),  # standing: |v - v*| = |v*|
        ((0.0, 0.75, 0.0), np.exp(-0.75)),  # half as fast
        ((1.5, 0.0, 0.0), np.exp(-6.0)),  # at right angles
    ],
)
def test_heading_reward(velocity, expected):
    seen = kinematics(velocity={"pelvis": velocity})
    _, output = HEADING_STEP(KEY, heading_state(), seen)
    assert output.reward[0] == pytest.approx(expected, rel=1e-5)
    assert not output.terminated[0]


def test_heading_is_observed_from_the_character():
    seen = kinematics(yaw=np.pi / 2)  # it faces +y, where it should go
    np.testing.assert_allclose(HEADING.observe(heading_state(), seen)[0], [1, 0, 1.5], atol=1e-6)


def test_heading_changes_when_its_time_is_over():
    seen = kinematics(yaw=1.0)
    after, _ = HEADING_STEP(KEY, heading_state(time_left=0.5), seen)
    np.testing.assert_allclose(after.direction, [[0.0, 1.0]])
    assert after.time_left[0] == pytest.approx(0.5 - DT)
    after, _ = HEADING_STEP(KEY, heading_state(time_left=DT / 2), seen)
    assert 3.0 <= after.time_left[0] <= 5.0
    yaw = np.arctan2(after.direction[0, 1], after.direction[0, 0])
    assert abs(yaw - 1.0) <= HEADING.turn
    assert np.linalg.norm(after.direction) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("place", "time_left", "velocity", "expected"),
    [
        # 4 m in 2.967 s need 1.348 m/s, which lies within 1.2 to 1.5
        ((4.0, 0.0), 3.0, (4.0 / (3.0 - DT), 0, 0), 1.0),
        ((4.0, 0.0), 3.0, (0, 0, 0), np.exp(-3.0)),
        # 8 m in 2 s would need 4 m/s: 1.5 at most
        ((8.0, 0.0), 2.0, (1.5, 0, 0), 1.0),
        # 1 m in 3 s would need a third: 1.2 at least
        ((0.0, 1.0), 3.0, (0, 1.2, 0), 1.0),
        ((0.0, 1.0), 3.0, (0, 0.6, 0), np.exp(-0.75)),
        # within half a metre everything is well
        ((0.3, 0.3), 3.0, (-2.0, 0, 0), 1.0),
    ],
)
def test_location_reward(place, time_left, velocity, expected):
    seen = kinematics(velocity={"pelvis": velocity})
    _, output = LOCATION_STEP(KEY, location_state(place, time_left), seen)
    assert output.reward[0] == pytest.approx(expected, rel=1e-4)
    assert not output.terminated[0]


def test_location_observation():
    seen = kinematics(position={"pelvis": (1.0, 0.0, 0.9)}, yaw=np.pi / 2)
    observed = LOCATION.observe(location_state((3.0, 0.0), 4.0), seen)[0]  # 2 m to its right
    np.testing.assert_allclose(observed, [0.0, -1.0, 0.5, 2 / 3], atol=1e-6)
    observed = LOCATION.observe(location_state((100.0, 0.0), 4.0), seen)[0]
    np.testing.assert_allclose(observed[2:], [1.5, 1.5], atol=1e-6)  # both at their most


def test_location_success_is_having_been_there():
    near, far = kinematics(), kinematics(position={"pelvis": (3.0, 0.0, 0.9)})
    state, output = LOCATION_STEP(KEY, location_state((0.4, 0.0)), near)
    assert np.isnan(output.success[0])  # the time is not over
    assert state.reached[0]
    state = state.replace(time_left=jnp.asarray([DT / 2]))
    after, output = LOCATION_STEP(KEY, state, far)
    assert output.success[0] == 1.0
    assert not after.reached[0]  # the next place
    _, output = LOCATION_STEP(KEY, location_state((9.0, 0.0), DT / 2), near)
    assert output.success[0] == 0.0


def test_a_new_place_is_within_reach():
    many = jax.tree.map(lambda x: jnp.repeat(x, 200, axis=0), kinematics())
    state = jax.jit(LOCATION.reset)(KEY, many)
    pace = np.linalg.norm(state.place, axis=1) / np.asarray(state.time_left)
    assert pace.min() >= 1.2 - 1e-5
    assert pace.max() <= 1.5 + 1e-5


def test_slack_brings_places_nearer():
    many = jax.tree.map(lambda x: jnp.repeat(x, 200, axis=0), kinematics())
    slow = TargetLocation(DT, slack=2.0)
    state, far = jax.jit(slow.reset)(KEY, many), jax.jit(LOCATION.reset)(KEY, many)
    np.testing.assert_array_equal(state.time_left, far.time_left)
    np.testing.assert_allclose(2.0 * state.place, far.place, rtol=1e-5)


def test_targets_are_turned_to_a_bearing():
    """The character at (1, 0) faces +y; 90 degrees to its left is -x."""
    goals = Goals((LOCATION, HEADING, AIMING))
    seen = kinematics(position={"pelvis": (1.0, 0.0, 0.9)}, yaw=np.pi / 2)
    states = (location_state((4.0, 4.0), 2.0), heading_state(), AIMING.reset(KEY, seen))
    turned = goals.toward(states, seen, jnp.full(1, np.pi / 2))
    np.testing.assert_allclose(turned[0].place, [[1.0 - 5.0, 0.0]], atol=1e-5)
    assert turned[0].time_left == states[0].time_left
    np.testing.assert_allclose(turned[1].direction, [[-1.0, 0.0]], atol=1e-6)
    assert turned[1].speed == states[1].speed
    assert turned[2] is states[2]  # an arm's direction, not one on the floor


@pytest.mark.parametrize(
    ("hand", "expected"),
    [
        ((0.3, 0.0, 1.0), 1.0),  # along it
        ((0.0, 0.3, 1.0), np.exp(-2 * np.sqrt(2))),  # at right angles: the gap is L sqrt 2
        ((-0.3, 0.0, 1.0), np.exp(-4.0)),  # the other way: 2 L
    ],
)
def test_aiming_reward(hand, expected):
    seen = kinematics(position={"forearm_r": (0.0, 0.0, 1.0), "hand_r": hand})
    state = AimingState(direction=jnp.asarray([[1.0, 0.0, 0.0]]), time_left=jnp.asarray([1.0]))
    _, output = AIMING_STEP(KEY, state, seen)
    assert output.reward[0] == pytest.approx(expected, rel=1e-5)


def test_aiming_is_observed_from_the_character():
    state = AimingState(direction=jnp.asarray([[0.0, 0.6, 0.8]]), time_left=jnp.asarray([1.0]))
    observed = AIMING.observe(state, kinematics(yaw=np.pi / 2))[0]
    np.testing.assert_allclose(observed, [0.6, 0.0, 0.8], atol=1e-6)


def test_new_aims_lie_around_the_heading():
    many = jax.tree.map(lambda x: jnp.repeat(x, 200, axis=0), kinematics(yaw=1.0))
    aims = np.asarray(jax.jit(AIMING.reset)(KEY, many).direction)
    np.testing.assert_allclose(np.linalg.norm(aims, axis=1), 1.0, atol=1e-5)
    yaw, pitch = np.arctan2(aims[:, 1], aims[:, 0]) - 1.0, np.arcsin(aims[:, 2])
    assert 0.7 < np.abs(yaw).max() <= AIMING.yaw + 1e-4
    assert AIMING.pitch[0] - 1e-4 <= pitch.min() < 0 < pitch.max() <= AIMING.pitch[1] + 1e-4


def test_goals_combine():
    goals = Goals((LOCATION, AIMING))
    seen = kinematics(position={"hand_r": (0.3, 0.0, 0.0)})
    states = jax.jit(goals.reset)(KEY, seen)
    assert goals.observe(states, seen).shape == (1, 7) == (1, goals.observation_size)
    after, outputs = jax.jit(goals.step)(KEY, states, seen)
    assert goals.names == ("target_location", "aiming")
    alone, output = AIMING.step(jax.random.split(KEY, 2)[1], states[1], seen)
    np.testing.assert_allclose(outputs[1].reward, output.reward, rtol=1e-6)
    np.testing.assert_allclose(after[1].time_left, alone.time_left)
    assert goals.command(states, seen) is None
    row = jax.tree.map(lambda x: x[0], (states, seen))
    assert [marker.reach is None for marker in goals.markers(*row)] == [True, False]


def test_goals_by_name():
    character = load_character(PhysicsConfig(character="humanoid28"))
    goals = make_goals({"target_location": {"speed": [2, 4]}, "aiming": {}}, character, DT)
    location, aiming = goals.goals
    assert location.speed == (2.0, 4.0)
    assert aiming.hand == character.link("hand_r")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"target_locaton": {}}, r"composite\.goals: .*mean 'target_location'.*aiming"),
        ({"aiming": {"pich": 1}}, r"composite\.goals\.aiming: .*mean 'pitch'"),
        ({"aiming": {"pitch": 1}}, r"aiming\.pitch: expected 2 rising numbers .* got 1"),
        ({"aiming": {"hand": 1}}, r"goals\.aiming: unknown 'hand'"),
        ({"target_heading": {"speed": [2, 1]}}, r"heading\.speed: expected 2 rising"),
        ({"target_heading": {"turn": "far"}}, r"turn: expected a number .* got 'far'"),
    ],
)
def test_wrong_settings_name_the_key_and_the_choices(settings, message):
    character = load_character(PhysicsConfig(character="humanoid28"))
    with pytest.raises(ConfigError, match=message):
        make_goals(settings, character, DT)


def test_orders_are_held_past_their_time():
    """Asked again before every step, a target neither ends nor is drawn anew."""
    order = {"place": (1.0, 2.0), "within_s": 0.5}
    state = LOCATION.steer(location_state(reached=True), order, 0.0)
    assert not bool(state.reached[0])
    np.testing.assert_allclose(state.time_left, [1.0])  # at least what it is held for
    later, out = LOCATION_STEP(KEY, LOCATION.steer(state, order, 60.0), kinematics())
    np.testing.assert_allclose(later.place, [[1.0, 2.0]])
    assert np.isnan(out.success[0])
    far = LOCATION.steer(state, {"place": (9.0, 0.0), "within_s": 6.0}, 2.0)
    np.testing.assert_allclose(far.time_left, [4.0])


def test_orders_of_directions():
    heading = HEADING.steer(heading_state(), {"yaw_deg": 180.0, "speed": None}, 0.0)
    np.testing.assert_allclose(heading.direction, [[-1.0, 0.0]], atol=1e-6)
    np.testing.assert_allclose(heading.speed, [1.35])
    aim = AIMING.steer(None, {"yaw_deg": 90.0, "pitch_deg": 30.0}, 0.0)
    np.testing.assert_allclose(aim.direction, [[0.0, np.sqrt(0.75), 0.5]], atol=1e-6)
