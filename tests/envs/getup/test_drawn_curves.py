"""Drawn curves: how far they are from their styles, and that they stay plausible."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import changed, tiny_task

from getup_jax.config import ConfigError, CurriculumConfig, TaskConfig
from getup_jax.envs.getup.curriculum.state import CurriculumState
from getup_jax.envs.getup.drawn_curves import (
    NOISE_RMS,
    Curve,
    covered_height,
    draw_curves,
    fastest_rise,
    fastest_turn,
    mirrored,
    smooth_noise,
    style_curve,
)
from getup_jax.envs.getup.episode import CLIP, LYING, STANDING
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.curves import NUM_POINTS

B = 6000
SUPINE, LATE, PRONE, SIDE, OTHER_SIDE = range(5)
KEY = jax.random.PRNGKey(3)
ALL = CurriculumConfig(drawn_curves=1.0)
MATCH_RAD = TaskConfig().curve_match_rad


class Styles(NamedTuple):
    points: jax.Array
    duration: jax.Array


def style(first: tuple[float, float], heights: list[float]) -> np.ndarray:
    """Angles that go from the first ones to upright, in a straight line."""
    angles = np.linspace(first, (np.pi / 2, np.pi / 2), NUM_POINTS)
    return np.concatenate([np.asarray(heights)[:, None], angles], axis=1)


EVEN = [0.11, 0.15, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.45]
STEEP = [0.11, 0.11, 0.11, 0.11, 0.2, 0.4, 0.9, 1.5, 1.45]
LIBRARY = Styles(
    points=jnp.asarray(
        np.stack(
            [
                style((np.pi / 2, 0.05), EVEN),
                style((np.pi / 2, 0.3), STEEP),
                style((np.pi / 2, 3.2), EVEN),  # an angle beyond pi
                style((0.1, np.pi / 2), EVEN),
                style((np.pi - 0.1, np.pi / 2), STEEP),
            ]
        ),
        jnp.float32,
    ),
    duration=jnp.asarray([6.0, 3.0, 4.0, 5.0, 5.0]),
)


def draw(config: CurriculumConfig = ALL, kind: int = LYING, library=LIBRARY, key=KEY) -> Curve:
    styles = jnp.arange(B) % len(library.duration)
    return draw_curves(config, MATCH_RAD, library, key, styles, jnp.full(B, kind))


def of(curve: Curve, number: int) -> Curve:
    return jax.tree.map(lambda x: np.asarray(x[number :: len(LIBRARY.duration)]), curve)


def alone(number: int) -> Styles:
    return Styles(*(x[number : number + 1] for x in LIBRARY))


# The noise.


@pytest.mark.parametrize(("kind", "first"), [(LYING, 2), (CLIP, 1), (STANDING, 1)])
def test_the_moved_points_have_the_rms_that_is_said_and_the_others_stay(kind, first):
    noise = np.asarray(smooth_noise(KEY, jnp.full(40_000, kind)))
    moved = noise[:, first:-1]
    rms = np.sqrt((moved**2).mean(axis=0))  # of every point
    np.testing.assert_allclose(rms, np.tile(NOISE_RMS, (len(rms), 1)), rtol=0.02)
    np.testing.assert_array_equal(noise[:, :first], 0.0)
    np.testing.assert_array_equal(noise[:, -1], 0.0)


def test_neighbours_move_alike_and_the_curves_do_not():
    noise = np.asarray(smooth_noise(KEY, jnp.full(40_000, LYING)))[:, 2:-1]
    near = np.corrcoef(noise[:, 0, 0], noise[:, 1, 0])[0, 1]
    next_but_one = np.corrcoef(noise[:, 0, 0], noise[:, 2, 0])[0, 1]
    far = np.corrcoef(noise[:, 0, 0], noise[:, 4, 0])[0, 1]
    np.testing.assert_allclose([near, next_but_one, far], [2 / 3, 1 / 6, 0.0], atol=0.02)
    between = np.corrcoef(noise[:, 2].T)
    np.testing.assert_allclose(between, np.eye(3), atol=0.02)


def test_the_noise_of_a_curve_is_scaled_by_one_number():
    # one style alone is blended with its mirror image, which it is itself
    library = Styles(alone(SUPINE).points.at[:, :, 1].set(np.pi / 2), alone(SUPINE).duration)
    own = np.asarray(library.points[0])
    none = draw(dataclasses.replace(ALL, curve_noise=0.0), library=library)
    np.testing.assert_allclose(none.points, np.tile(own, (B, 1, 1)), atol=1e-6)
    half = draw(dataclasses.replace(ALL, curve_noise=0.5), library=library)
    # in the middle of the curve, nothing is at a limit
    moved = np.sqrt(((half.points - own)[:, 4] ** 2).mean(axis=0))
    np.testing.assert_allclose(moved, 0.5 * np.asarray(NOISE_RMS), rtol=0.05)


# The blend.


def test_a_blend_is_of_styles_that_start_alike_and_mostly_of_the_own_one():
    drawn = of(draw(dataclasses.replace(ALL, curve_noise=0.0)), SUPINE)
    own, late = (np.asarray(LIBRARY.points[i, :, 0]) for i in (SUPINE, LATE))
    share = (drawn.points[..., 0] - own) @ (late - own) / ((late - own) @ (late - own))
    np.testing.assert_allclose(drawn.points[..., 0], own + share[:, None] * (late - own), atol=1e-5)
    assert share.min() >= -1e-6
    assert 0.48 < share.max() < 0.501
    blended = share > 1e-6  # the others are with itself
    assert 0.45 < blended.mean() < 0.55
    assert np.abs(share[blended].mean() - 0.25) < 0.02
    other = (drawn.points[..., 2] <= np.pi / 2 + 1e-6).all()
    assert other  # never with the one that lies prone


def test_the_mirror_image_of_a_style_is_a_partner():
    drawn = of(draw(dataclasses.replace(ALL, curve_noise=0.0)), SIDE)
    image = np.asarray(mirrored(LIBRARY.points[OTHER_SIDE]))
    np.testing.assert_allclose(image[0, 1], 0.1, atol=1e-5)
    late = drawn.points[:, 3, 0] < 0.4  # .5 in the own one, .11 in the other one
    assert 0.2 < late.mean() < 0.5
    assert np.abs(drawn.points[:, 0, 1] - 0.1).max() < 1e-5


def test_the_first_angles_stay_within_reach_of_the_start_pose():
    drawn = draw()
    own = np.asarray(LIBRARY.points)[np.arange(B) % 5]
    gap = np.abs(drawn.points[:, 0, 1:] - own[:, 0, 1:]).max()
    assert gap <= 0.5 * MATCH_RAD


# Styles that go over to others, and curves that begin at the pose.


def still(**changes) -> CurriculumConfig:
    return dataclasses.replace(ALL, curve_noise=0.0, **changes)


def test_a_transition_leaves_one_style_and_ends_as_another():
    two = np.array([SUPINE, SIDE])
    exact = Styles(LIBRARY.points[two], LIBRARY.duration[two])
    config = still(style_transitions=1.0, transition_rad=np.pi)
    drawn = draw(config, library=exact)
    points = np.asarray(drawn.points[::2])  # those of the supine style
    supine, side = np.asarray(exact.points)
    gone = points[:, 6, 1] < np.pi / 2 - 0.01  # the supine one has pi / 2
    assert 0.2 < gone.mean() < 0.3  # of four partners, which are the two and their images
    np.testing.assert_allclose(points[:, :2], np.broadcast_to(supine[:2], (len(points), 2, 3)))
    np.testing.assert_allclose(points[gone][:, 6:], np.broadcast_to(side[6:], (gone.sum(), 3, 3)))


def test_transitions_go_no_further_than_is_set():
    near = of(draw(still(style_transitions=1.0, transition_rad=0.6)), SUPINE)
    assert (near.points[..., 2] <= np.pi / 2 + 1e-5).all()  # none to prone
    without = draw(still())
    few = draw(still(style_transitions=0.3))
    same = (np.asarray(few.points) == np.asarray(without.points)).all(axis=(1, 2))
    assert 0.7 - 0.02 < same.mean() < 1.0


def test_no_transition_turns_faster_than_the_library():
    config = still(style_transitions=1.0, transition_rad=np.pi, duration_range=(0.5, 0.5))
    fastest = np.asarray(fastest_turn(LIBRARY.points, LIBRARY.duration)).max() / 0.5
    drawn = draw(config)
    turns = np.asarray(fastest_turn(drawn.points, drawn.duration))
    assert fastest * 0.99 < turns.max() < fastest * 1.001


def test_a_fast_turn_is_the_largest_step_of_an_angle():
    points = np.zeros((1, NUM_POINTS, 3))
    points[0, 4:, 1] = -0.5
    points[0, 6:, 2] = 0.3
    points[0, :, 0] = 9.0 * np.arange(NUM_POINTS)  # heights are no angles
    np.testing.assert_allclose(fastest_turn(jnp.asarray(points), jnp.asarray([2.0])), 0.5 * 8 / 2)


def test_a_curve_that_begins_at_the_pose_joins_the_drawn_one():
    pose = jnp.broadcast_to(jnp.asarray([0.2, 1.0, 0.5]), (B, 3))
    drawn = draw(still(start_at_pose=0.5))
    points = np.asarray(drawn.from_pose(pose))
    moved = (points != np.asarray(drawn.points)).any(axis=(1, 2))
    assert abs(moved.mean() - 0.5) < 0.03
    np.testing.assert_allclose(points[moved][:, 0], pose[moved], atol=1e-6)
    gap = points - np.asarray(drawn.points)
    np.testing.assert_allclose(gap[moved][:, 1], gap[moved][:, 0], atol=1e-6)  # and its slope
    np.testing.assert_array_equal(gap[:, 6:], 0.0)
    shrinks = np.diff(np.abs(gap), axis=1)
    assert (shrinks <= 1e-6).all()
    np.testing.assert_array_equal(drawn.points, draw(still()).points)  # the same draws


def test_episodes_that_do_not_start_lying_keep_their_curves():
    drawn = draw(still(start_at_pose=1.0), kind=CLIP)
    pose = jnp.zeros((B, 3))
    np.testing.assert_array_equal(drawn.from_pose(pose), drawn.points)


# The duration.


def test_durations_are_in_the_range_that_is_set():
    scale = np.asarray(draw(still(), library=alone(PRONE)).duration) / 4.0
    assert 0.75 <= scale.min() < 0.76
    assert 1.29 < scale.max() <= 1.3
    assert abs(scale.mean() - 1.025) < 0.01
    exact = still(duration_range=(1.0, 1.0))
    np.testing.assert_allclose(draw(exact, library=alone(PRONE)).duration, 4.0, rtol=1e-6)


# Plausible.


def test_drawn_curves_stay_plausible():
    drawn = draw(dataclasses.replace(ALL, curve_noise=3.0))
    low, high = (float(x) for x in covered_height(LIBRARY))
    assert (low, high) == pytest.approx((0.16, 1.46), abs=0.02)
    points = np.asarray(drawn.points)
    lowest = np.asarray(LIBRARY.points[..., 0]).min()
    assert points[:, 0, 0].min() == pytest.approx(lowest)  # a style's own may be lower
    assert points[:, -2, 0].max() <= 1.5 + 1e-5  # or higher
    for number in range(5):
        of_style = of(drawn, number).points
        own = np.asarray(LIBRARY.points[number])
        assert of_style[..., 0].min() >= min(low, own[:, 0].min()) - 1e-5
        assert of_style[..., 0].max() <= max(high, 1.5) + 1e-5
        assert of_style[..., 1:].min() >= -1e-6
        assert of_style[..., 1:].max() <= max(np.pi, own[:, 1:].max()) + 1e-5
    assert points[:, 0, 2].max() > np.pi  # the one that was beyond
    rise = np.asarray(fastest_rise(drawn.points, drawn.duration))
    limit = float(fastest_rise(*LIBRARY).max()) / 0.75
    assert rise.max() <= limit * (1 + 1e-5)
    assert (np.isclose(rise, limit, rtol=1e-4)).mean() > 0.01  # some were slowed down


def test_no_curve_rises_faster_than_its_bound():
    s = jnp.linspace(0.0, 1.0, 401)
    for points, duration in zip(*LIBRARY, strict=True):
        height = np.asarray(curves.evaluate(jnp.broadcast_to(points, (401, 9, 3)), s))[:, 0]
        slope = np.diff(height).max() * 400 / float(duration)
        bound = float(fastest_rise(points, duration))
        assert 0.7 * bound < slope <= bound * (1 + 1e-3)


# Which episodes have one.


def test_the_share_of_drawn_curves_is_that_of_the_setting():
    drawn = draw(dataclasses.replace(ALL, drawn_curves=0.3))
    own = style_curve(LIBRARY, jnp.arange(B) % 5)
    same = (np.asarray(drawn.points) == np.asarray(own.points)).all(axis=(1, 2))
    assert abs(same.mean() - 0.7) < 0.02
    np.testing.assert_array_equal(same, np.asarray(drawn.duration == own.duration))


def test_without_drawn_curves_starts_are_what_they_were(built):
    world, aids, none = built.world, built.environment.curriculum, CurriculumState()
    starts = aids.draw(world, none, KEY, 64)
    assert aids.with_curves(world, KEY, starts) is starts
    config = dataclasses.replace(aids.config, drawn_curves=0.5)
    some = dataclasses.replace(aids, config=config)
    drawn = some.with_curves(world, KEY, some.draw(world, none, KEY, 64))
    for name in ("getup", "kind", "row"):
        np.testing.assert_array_equal(getattr(drawn, name), getattr(starts, name))
    again = some.with_curves(world, KEY, starts)
    jax.tree.map(np.testing.assert_array_equal, again.curve, drawn.curve)
    elsewhere = some.with_curves(world, KEY, starts, 32)
    assert (np.asarray(elsewhere.curve.points) != np.asarray(drawn.curve.points)).any()


# In the task.


def test_episodes_carry_their_curves(character):
    config = changed(drawn_curves=0.5, stand_start=0.2, reference_start=0.4)
    built = tiny_task(character, config)
    env, world = built.environment, built.world
    state = jax.jit(env.init, static_argnums=2)(world, KEY, 64)
    own = style_curve(world, state.getup)
    drawn = ~np.isclose(state.points, own.points).all(axis=(1, 2))
    assert 0.3 < drawn.mean() < 0.7
    np.testing.assert_array_equal(state.duration[~drawn], own.duration[~drawn])
    expected = curves.evaluate(state.points[:, None], (state.time / state.duration)[:, None])
    np.testing.assert_allclose(env.targets(state)[:, 0], expected[:, 0], atol=1e-6)
    standing = np.asarray(state.kind) == STANDING
    np.testing.assert_allclose(state.time[standing], state.duration[standing], rtol=1e-6)

    after, _ = jax.jit(env.advance)(world, state, state.action)
    np.testing.assert_array_equal(after.points, state.points)


def test_starts_along_the_clip_keep_their_phase(built):
    env, world = built.environment, built.world
    style, rows = jnp.zeros(4, int), jnp.arange(4)
    own = style_curve(world, style)
    other = own.replace(duration=1.3 * own.duration, points=own.points + 0.1)
    start = jax.jit(env.start)
    before = start(world, style, jnp.full(4, CLIP), rows)
    after = start(world, style, jnp.full(4, CLIP), rows, other)
    assert np.asarray(before.time).max() > 0.0
    np.testing.assert_allclose(
        after.time / after.duration, before.time / before.duration, rtol=1e-6
    )
    np.testing.assert_array_equal(after.physics.kinematics.qpos, before.physics.kinematics.qpos)
    np.testing.assert_array_equal(after.points, other.points)


def test_lying_starts_may_begin_where_the_body_is(character):
    config = changed(drawn_curves=1.0, start_at_pose=1.0, reference_start=0.3)
    built = tiny_task(character, config)
    env, world = built.environment, built.world
    state = jax.jit(env.init, static_argnums=2)(world, KEY, 64)
    features = env.observer.posture(state.physics.kinematics, world.terrain).features
    lying = np.asarray(state.kind) == LYING
    assert 10 < lying.sum() < 64
    np.testing.assert_allclose(env.targets(state)[lying, 0], features[lying], atol=1e-5)


def test_an_episode_that_starts_anew_gets_a_curve_of_its_own(character):
    built = tiny_task(character, changed(drawn_curves=1.0))
    env, world = built.environment, built.world
    state = jax.jit(env.init, static_argnums=2)(world, KEY, 8)
    ending = state.replace(time=state.time.at[:4].set(99.0))
    after, output = jax.jit(env.step)(world, ending, state.action)
    np.testing.assert_array_equal(output.truncated[:4], True)
    new = (np.asarray(after.points) != np.asarray(state.points)).any(axis=(1, 2))
    np.testing.assert_array_equal(new, np.asarray(output.truncated | output.terminated))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"drawn_curves": 1.5}, r"curriculum\.drawn_curves: expected .* from 0 to 1, got 1\.5"),
        ({"style_transitions": 2.0}, r"curriculum\.style_transitions: expected .* from 0 to 1"),
        ({"start_at_pose": -0.1}, r"curriculum\.start_at_pose: expected .* from 0 to 1"),
        ({"transition_rad": 4.0}, r"curriculum\.transition_rad: expected .* from 0 to 3\.14"),
        ({"curve_noise": -1.0}, r"curriculum\.curve_noise: expected .* from 0 to 10, got -1\.0"),
        ({"duration_range": (1.3, 0.7)}, r"curriculum\.duration_range: .* the smaller one first"),
        (
            {"duration_range": (0.0, 1.0)},
            r"curriculum\.duration_range\[0\]: expected a number more than 0",
        ),
    ],
)
def test_mistakes_of_the_settings(settings, message):
    with pytest.raises(ConfigError, match=message):
        CurriculumConfig(**settings)
