from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import LATENT, untrained_prior

from compiled import compiled
from getup_jax.config import CurriculumConfig
from getup_jax.envs.getup.drawn_curves import style_curve
from getup_jax.envs.getup.episode import CLIP, LYING, STANDING, EpisodeState

B = 4
CLIP_STYLE, CURVE_STYLE = 0, 1


class Jitted:
    """The task's functions, compiled once for all tests."""

    def __init__(self, built):
        self.task, self.world = built.environment, built.world
        self.start_rows = compiled(self.task.start)
        self.advance = compiled(self.task.advance)
        self.step = compiled(self.task.step)
        self.servo_target = compiled(self.task.servo_target)
        self.play = compiled(self._play, static_argnums=2)

    def start(self, kind: int, style: int = CLIP_STYLE) -> EpisodeState:
        rows = jnp.arange(B, dtype=jnp.int32)
        return self.start_rows(self.world, jnp.full(B, style), jnp.full(B, kind), rows)

    def _play(self, world, state, steps):
        """States and outputs [T, ...] while every action repeats the last one."""

        def one(state, _):
            state, output = self.task.advance(world, state, state.action)
            return state, (state, output)

        return jax.lax.scan(one, state, None, length=steps)


@pytest.fixture(scope="session")
def jitted(built) -> Jitted:
    return Jitted(built)


def at_time(state: EpisodeState, seconds: float) -> EpisodeState:
    return state.replace(time=jnp.full_like(state.time, seconds))


def no_action() -> jax.Array:
    return jnp.zeros((B, LATENT + 49))


# The action.


def test_sizes(built):
    task = built.environment
    assert (task.observation_size, task.action_size, task.num_objectives) == (352, 65, 1)


@pytest.mark.parametrize("kind", [LYING, STANDING, CLIP])
def test_the_first_servo_target_is_the_start_pose(jitted, character, kind):
    world = jitted.world.replace(prior=untrained_prior(character))
    rows = jnp.arange(B, dtype=jnp.int32)
    state = jitted.start_rows(world, jnp.zeros(B, int), jnp.full(B, kind), rows)
    pose = np.asarray(state.physics.kinematics.qpos[:, 7:])
    expected = np.clip(pose, world.target_lower, world.target_upper)
    got = jitted.servo_target(world, state, state.action)
    np.testing.assert_allclose(got, expected, atol=1e-4)
    assert np.abs(np.asarray(state.action[:, :LATENT])).max() > 0.1


def test_the_filter_keeps_four_fifths_of_the_last_action(jitted):
    state = jitted.start(STANDING)
    action = jax.random.normal(jax.random.PRNGKey(0), (B, 65))
    after, _ = jitted.advance(jitted.world, state, action)
    np.testing.assert_allclose(after.action, 0.2 * action + 0.8 * state.action, atol=1e-6)
    again, _ = jitted.advance(jitted.world, after, action)
    np.testing.assert_allclose(again.action, 0.36 * action + 0.64 * state.action, atol=1e-6)


def test_offsets_are_added_in_radians_and_limited(jitted, character):
    state = jitted.start(STANDING)
    offset = jnp.linspace(-0.3, 0.3, 49)
    filtered = no_action().at[:, LATENT:].set(offset)
    target = np.asarray(jitted.servo_target(jitted.world, state, filtered))
    np.testing.assert_allclose(target[0], character.neutral_qpos[7:] + offset, atol=1e-5)
    far = np.asarray(jitted.servo_target(jitted.world, state, no_action().at[:, -1].set(100.0)))
    margin = jitted.task.config.target_margin_rad
    np.testing.assert_allclose(far[:, -1], character.joint_upper[-1] + margin, rtol=1e-6)


def test_the_servo_target_goes_to_the_engine(jitted):
    state = jitted.start(LYING)
    action = 0.5 * jax.random.normal(jax.random.PRNGKey(1), (B, 65))
    after, _ = jitted.advance(jitted.world, state, action)
    target = jitted.servo_target(jitted.world, state, 0.2 * action + 0.8 * state.action)
    expected = jax.jit(jitted.task.engine.step)(state.physics, target)
    np.testing.assert_allclose(after.physics.kinematics.qpos, expected.kinematics.qpos, atol=1e-5)


# Starts.


def test_a_standing_start_is_at_the_end_of_its_curve(jitted):
    state = jitted.start(STANDING, CURVE_STYLE)
    world = jitted.world
    np.testing.assert_array_equal(state.time, state.duration)
    np.testing.assert_allclose(state.duration, 2.0)
    now = np.asarray(jitted.task.targets(state))
    end = np.broadcast_to(world.points[CURVE_STYLE, -1], now.shape)
    np.testing.assert_allclose(now, end, atol=1e-5)
    assert now.shape == (B, 4, 3)


def test_a_lying_start_is_at_the_start_of_its_curve(jitted):
    state = jitted.start(LYING)
    np.testing.assert_array_equal(state.time, 0.0)
    now = np.asarray(jitted.task.targets(state))
    np.testing.assert_allclose(now[:, 0], np.tile(jitted.world.points[0, 0], (B, 1)), atol=1e-5)
    # 300 ms of a straight line of 1 s
    ahead = np.asarray(0.7 * jitted.world.points[0, 0] + 0.3 * jitted.world.points[0, -1])
    np.testing.assert_allclose(now[:, 3], np.tile(ahead, (B, 1)), atol=1e-4)
    assert float(state.physics.kinematics.qpos[:, 2].max()) < 0.2


def test_a_scaled_duration_stretches_the_episode(jitted):
    kind, row = jnp.full(B, STANDING), jnp.arange(B)
    own = style_curve(jitted.world, jnp.zeros(B, int))
    twice = own.replace(duration=2.0 * own.duration)
    slow = jitted.start_rows(jitted.world, jnp.zeros(B, int), kind, row, twice)
    np.testing.assert_allclose(slow.duration, 2.0)
    np.testing.assert_allclose(slow.time, 2.0)


def test_the_first_observation_has_the_action_and_the_targets(jitted):
    state = jitted.start(STANDING)
    where = jitted.task.observer.slices()
    assert state.observation.shape == (B, 352)
    np.testing.assert_array_equal(state.observation[:, where["action"]], state.action)
    targets = jitted.task.targets(state).reshape(B, 12)
    np.testing.assert_allclose(state.observation[:, where["targets"]], targets, atol=1e-6)


# Early ends.


def test_ten_steps_of_low_reward_end_an_episode_and_nine_do_not(jitted):
    # standing while the curve lies: the height alone gives exp(-1.7 * 1.3) = 0.1
    state = at_time(jitted.start(STANDING), -1.0)
    _, (states, outputs) = jitted.play(jitted.world, state, 12)
    assert (np.asarray(outputs.terms["task"]) < 0.1).all()
    low = np.asarray(outputs.ended["low_reward"])
    np.testing.assert_array_equal(low[:9], 0.0)
    np.testing.assert_array_equal(low[9:], 1.0)
    np.testing.assert_array_equal(outputs.terminated, low.astype(bool))
    assert not np.asarray(outputs.ended["head"]).any()
    assert not np.asarray(outputs.truncated).any()
    np.testing.assert_array_equal(states.low_steps[:, 0], np.arange(1, 13))


def test_one_good_step_starts_the_count_of_low_ones_again(jitted):
    state = at_time(jitted.start(STANDING), -1.0).replace(low_steps=jnp.full(B, 9))
    good, output = jitted.advance(jitted.world, at_time(state, 1.5), state.action)
    assert not np.asarray(output.terminated).any()
    np.testing.assert_array_equal(good.low_steps, 0)


def head_down(jitted, character) -> EpisodeState:
    """On the back long before the curve's start, so that the reward stays high."""
    state = jitted.start(LYING)
    qpos = np.array(state.physics.kinematics.qpos)
    qpos[:, 7 + character.joint("neck_flex")] = -0.1  # the back of the head down
    physics = jitted.task.engine.place(qpos, np.zeros((B, 55)))
    return at_time(state.replace(physics=physics), -9.0)


def test_the_head_on_the_floor_for_ten_steps_ends_an_episode(jitted, character):
    _, (_, outputs) = jitted.play(jitted.world, head_down(jitted, character), 12)
    head = np.asarray(outputs.ended["head"])
    np.testing.assert_array_equal(head[:9], 0.0)
    np.testing.assert_array_equal(head[9:], 1.0)
    np.testing.assert_array_equal(outputs.terminated, head.astype(bool))
    assert not np.asarray(outputs.ended["low_reward"]).any()


def test_within_its_grace_a_head_on_the_floor_costs_the_reward_alone(jitted, character):
    aids = jitted.task.curriculum
    config = dataclasses.replace(aids.config, head_grace_s=0.1)  # three steps
    lenient = Jitted.__new__(Jitted)
    lenient.task = dataclasses.replace(
        jitted.task, curriculum=dataclasses.replace(aids, config=config)
    )
    _, (_, outputs) = jax.jit(lenient._play, static_argnums=2)(
        jitted.world, head_down(jitted, character), 14
    )
    reward = np.asarray(outputs.reward)[..., 0]
    assert (reward[:9] > 0.1).all()
    np.testing.assert_array_equal(reward[9:], 0.0)
    assert (np.asarray(outputs.terms["task"]) > 0.1).all()
    head = np.asarray(outputs.ended["head"])
    np.testing.assert_array_equal(head[:12], 0.0)
    np.testing.assert_array_equal(head[12:], 1.0)


def test_a_raised_head_ends_nothing(jitted, character):
    state = jitted.start(LYING)
    raised = no_action().at[:, LATENT + character.joint("neck_flex")].set(0.8)
    raised = raised.at[:, LATENT + character.joint("head_flex")].set(0.8)
    state = at_time(state.replace(action=raised), -9.0)
    _, (states, outputs) = jitted.play(jitted.world, state, 12)
    assert np.asarray(states.head_steps[-1] == 0).all()
    assert not np.asarray(outputs.terminated).any()


# A whole episode.


@pytest.fixture(scope="module")
def standing_episode(jitted):
    """States and outputs of 3 s and two more steps of holding the neutral pose."""
    _, trace = jitted.play(jitted.world, jitted.start(STANDING), 92)
    return jax.tree.map(np.asarray, trace)


def test_the_episode_is_truncated_three_seconds_after_the_curve(standing_episode):
    _, outputs = standing_episode
    assert not outputs.terminated[:90].any()
    np.testing.assert_array_equal(outputs.truncated[:89], False)
    np.testing.assert_array_equal(outputs.truncated[89], True)


def test_holding_the_neutral_pose_is_a_success_with_nearly_full_reward(standing_episode):
    states, outputs = standing_episode
    end = {name: value[89] for name, value in outputs.episode.items()}
    np.testing.assert_array_equal(end["stand_success"], 1.0)
    for name in ("success", "clip_success", "return_rate_lying", "height_error_m"):
        assert np.isnan(end[name]).all(), name
    assert (end["return_rate"] > 0.9).all()
    assert (end["return_rate"] <= 1.0).all()
    total = states.record.task_reward[89] / 90
    np.testing.assert_allclose(end["return_rate"], total, rtol=1e-5)
    np.testing.assert_array_equal(states.record.stand_steps[89], 90)
    assert not np.any(outputs.episode["stand_success"][:89] == 1.0)


def test_the_reward_is_the_product_of_its_terms(standing_episode):
    _, outputs = standing_episode
    terms = {name: outputs.terms[name] for name in ("task", "natural", "total")}
    parts = ("height", "orientation", "velocity", "posture")
    product = np.prod([outputs.terms[name] for name in parts], axis=0)
    np.testing.assert_allclose(terms["task"], product, rtol=1e-5)
    np.testing.assert_allclose(terms["total"], terms["task"] * terms["natural"], rtol=1e-5)
    np.testing.assert_array_equal(outputs.reward[..., 0], terms["total"])
    np.testing.assert_array_equal(terms["natural"], 1.0)  # no offsets


def test_offsets_cost_naturalness(jitted):
    state = jitted.start(STANDING)
    filtered = no_action().at[:, LATENT:].set(0.1)
    _, output = jitted.advance(jitted.world, state.replace(action=filtered), filtered)
    # |dq|_1 = 4.9 of c = 10
    np.testing.assert_allclose(output.terms["natural"], 1 - 0.49**2, rtol=1e-4)


def test_offsets_that_hold_the_start_cost_nothing_while_the_filter_forgets_them(jitted, character):
    world = jitted.world.replace(prior=untrained_prior(character))  # no pose is near its own
    rows, style = jnp.arange(B, dtype=jnp.int32), jnp.zeros(B, int)
    state = jitted.start_rows(world, style, jnp.full(B, LYING), rows)
    held = np.asarray(state.start_offset)
    assert np.abs(held).sum(axis=1).min() > 1.0
    idle = state.action.at[:, LATENT:].set(0.0)  # asks for no offset
    after, output = jitted.advance(world, state, idle)
    np.testing.assert_allclose(after.start_offset, 0.8 * held, rtol=1e-5)
    np.testing.assert_allclose(after.action[:, LATENT:], 0.8 * state.action[:, LATENT:], rtol=1e-5)
    np.testing.assert_allclose(output.terms["natural"], 1.0, atol=1e-6)


# Resets.


def test_step_resets_what_has_ended_and_nothing_else(jitted):
    state = jitted.start(LYING, CURVE_STYLE)
    ending = jnp.array([True, False, True, False])
    end = state.duration + jitted.task.config.stand_time_s
    state = state.replace(
        time=jnp.where(ending, end, 0.0), low_steps=jnp.full(B, 3), key=jax.random.PRNGKey(3)
    )
    after, output = jitted.step(jitted.world, state, state.action)
    kept, expected = jitted.advance(jitted.world, state, state.action)
    np.testing.assert_array_equal(output.truncated, ending)
    assert not np.asarray(output.terminated).any()
    np.testing.assert_allclose(output.final_observation, expected.final_observation, atol=1e-4)
    np.testing.assert_array_equal(output.observation, after.observation)
    ended, running = np.flatnonzero(ending), np.flatnonzero(~ending)
    np.testing.assert_allclose(after.observation[running], kept.observation[running], atol=1e-4)
    np.testing.assert_array_equal(after.record.rise_steps, np.where(ending, 0, 1))
    np.testing.assert_array_equal(after.low_steps[ended], 0)
    fresh = np.abs(np.asarray(after.observation - output.final_observation)).max(axis=1)
    assert (fresh[ended] > 0.1).all()
    # its physics is a row of the pool
    pool = np.asarray(jitted.world.pool.physics.engine)
    for row in np.asarray(after.physics.engine)[ended]:
        assert (pool == row).all(axis=1).any()


def test_staggered_episodes_are_cut_at_different_times_and_say_nothing_of_success(jitted):
    state = jitted.start(LYING, CURVE_STYLE)
    whole = state.duration + jitted.task.config.stand_time_s
    cut = jitted.task.stagger(state, jax.random.PRNGKey(5)).until
    assert len(np.unique(cut)) == B
    assert ((cut >= state.time) & (cut <= whole)).all()
    staggered = state.replace(until=cut, time=cut - 1e-3, key=jax.random.PRNGKey(3))
    after, output = jitted.step(jitted.world, staggered, state.action)
    np.testing.assert_array_equal(output.truncated, True)
    assert np.isnan(output.episode["success"]).all()
    np.testing.assert_array_equal(after.until, np.inf)  # what comes after runs to its end


def test_a_broken_simulation_is_reset_without_reward_and_the_run_goes_on(jitted):
    state = jitted.start(STANDING)
    qpos = np.array(state.physics.kinematics.qpos)
    qpos[1, 9] = np.nan
    physics = jitted.task.engine.place(qpos, np.zeros((B, 55)))
    state = state.replace(physics=physics, key=jax.random.PRNGKey(4))
    after, output = jitted.step(jitted.world, state, state.action)
    np.testing.assert_array_equal(output.terminated, [False, True, False, False])
    np.testing.assert_array_equal(output.ended["not_finite"], [0, 1, 0, 0])
    np.testing.assert_array_equal(output.reward[1], 0.0)
    assert (np.asarray(output.reward)[[0, 2, 3]] > 0.5).all()
    for metric in output.metrics.values():
        assert np.isfinite(metric).all()
    for _ in range(3):
        assert np.isfinite(output.final_observation).all()
        assert np.isfinite(after.observation).all()
        assert np.asarray(after.physics.kinematics.finite).all()
        after, output = jitted.step(jitted.world, after, after.action)
    assert np.isfinite(output.reward).all()


@pytest.mark.parametrize("number", [0, LATENT + 3])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_action_that_is_not_finite_ends_its_episode_and_no_later_one(jitted, number, value):
    state = jitted.start(STANDING).replace(key=jax.random.PRNGKey(4))
    after, output = jitted.step(jitted.world, state, state.action.at[1, number].set(value))
    np.testing.assert_array_equal(output.ended["not_finite"], [0, 1, 0, 0])
    np.testing.assert_array_equal(output.terminated, [False, True, False, False])
    np.testing.assert_array_equal(output.reward[1], 0.0)
    for _ in range(2):
        assert all(np.isfinite(x).all() for x in (output.final_observation, after.observation))
        assert np.isfinite(output.reward).all()
        after, output = jitted.step(jitted.world, after, after.action)
        assert not output.ended["not_finite"].any()


def test_the_same_key_gives_the_same_run(jitted):
    task, world = jitted.task, jitted.world

    def run(seed: int):
        state = compiled(task.init, static_argnums=2)(world, jax.random.PRNGKey(seed), B)
        state = state.replace(time=state.duration + 3.0)  # all of them reset in the first step
        state, _ = jitted.step(world, state, no_action())
        return jax.tree.map(np.asarray, jitted.step(world, state, no_action()))

    first, again, other = run(0), run(0), run(1)
    jax.tree.map(np.testing.assert_array_equal, first, again)
    assert not np.array_equal(first[0].observation, other[0].observation)


def test_resets_draw_the_kinds_in_their_shares_and_all_styles(jitted):
    count = 4000
    start = jax.jit(jitted.task.init, static_argnums=2)
    state = start(jitted.world, jax.random.PRNGKey(0), count)
    shares = np.bincount(np.asarray(state.kind), minlength=3) / count
    # standard errors are below 0.008
    np.testing.assert_allclose(shares, [0.5, 0.3, 0.2], atol=0.03)
    styles = np.bincount(np.asarray(state.getup), minlength=2) / count
    np.testing.assert_allclose(styles, 0.5, atol=0.03)
    height = np.asarray(state.physics.kinematics.qpos[:, 2])
    standing = np.asarray(state.kind) == STANDING
    assert (height[standing] > 0.9).all()
    assert (height[np.asarray(state.kind) == LYING] < 0.2).all()
    assert len(np.unique(height.round(6))) > 5


def test_a_share_of_zero_draws_nothing(jitted):
    aids = dataclasses.replace(jitted.task.curriculum, config=CurriculumConfig(), stand_start=0.0)
    task = dataclasses.replace(jitted.task, curriculum=aids)
    state = jax.jit(task.init, static_argnums=2)(jitted.world, jax.random.PRNGKey(0), 500)
    np.testing.assert_array_equal(state.kind, LYING)
