from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from tiny_composite import CONFIG, clips, tiny_composite

from getup_jax.config import ConfigError
from getup_jax.envs.composite.build import action_centre, action_scale, assemble_composite
from getup_jax.envs.composite.link_frames import FRAMES, LINK_STATE, observe
from getup_jax.envs.composite.reference_state_init import resampled
from getup_jax.envs.composite.reference_windows import window_at
from getup_jax.physics.character import load_character

SIZE = 16


@pytest.fixture(scope="module")
def character():
    return load_character(CONFIG.physics)


@pytest.fixture(scope="module")
def built(character):
    return tiny_composite(character)


@pytest.fixture(scope="module")
def steps(built):
    """The jitted step, and the outputs of a second of standing."""
    env, world = built.environment, built.world
    step = jax.jit(env.step)
    state = jax.jit(env.init, static_argnums=2)(world, jax.random.key(0), SIZE)
    outputs, states = [], [state]
    for _ in range(30):
        state, output = step(world, state, jnp.zeros((SIZE, env.action_size)))
        outputs.append(output)
        states.append(state)
    return step, states, outputs


def test_starts_lie_on_the_clip_with_the_frames_before(built, steps):
    _, states, _ = steps
    first = states[0].history
    assert first.shape == (SIZE, FRAMES + 1, 15, LINK_STATE)
    assert_allclose(first[:, -1, 0, :3], states[0].physics.kinematics.link_position[:, 0])
    # velocities belong to the positions: frame by frame the root's height changes by v dt
    height, rate = np.asarray(first[:, :, 0, 2]), np.asarray(first[:, :, 0, 9])
    assert_allclose(np.diff(height, axis=1), rate[:, :-1] / 30, atol=1e-3)


def test_history_moves_on_by_one_frame(steps):
    _, states, outputs = steps
    ended = np.asarray(outputs[0].terminated | outputs[0].truncated)
    kept, before, after = ~ended, states[0].history, states[1].history
    assert kept.any()
    assert_allclose(after[kept][:, :-1], before[kept][:, 1:])
    assert_allclose(after[:, -1, :, :3], states[1].physics.kinematics.link_position, atol=1e-6)


def test_observation_is_that_of_the_last_frames(built, steps):
    _, states, _ = steps
    state = states[5]
    assert state.observation.shape == (SIZE, built.environment.observation_size)
    assert_allclose(state.observation, jax.jit(observe)(state.history[:, 1:]), atol=1e-6)
    frames = state.observation.reshape(SIZE, FRAMES, 15, LINK_STATE)
    assert_allclose(frames[:, -1, 0, :2], 0.0, atol=1e-6)  # below the newest root
    assert_allclose(frames[:, -1, 0, 2], state.history[:, -1, 0, 2], atol=1e-6)


def test_observation_does_not_see_place_and_heading():
    rng = np.random.default_rng(0)
    history = rng.normal(size=(3, FRAMES, 15, LINK_STATE))
    turns = Rotation.random(3 * FRAMES * 15, random_state=1)
    history[..., 3:7] = turns.as_quat(scalar_first=True).reshape(3, FRAMES, 15, 4)
    yaw = Rotation.from_rotvec([0.0, 0.0, -1.3])
    moved = history.copy()
    for part in (slice(0, 3), slice(7, 10), slice(10, 13)):
        moved[..., part] = yaw.apply(history[..., part].reshape(-1, 3)).reshape(3, FRAMES, 15, 3)
    moved[..., :3] += [4.0, -7.0, 0.0]
    moved[..., 3:7] = (yaw * turns).as_quat(scalar_first=True).reshape(3, FRAMES, 15, 4)
    see = jax.jit(observe)
    assert_allclose(see(history), see(moved), atol=1e-4)


def test_windows_are_those_of_the_groups(built, steps):
    _, _, outputs = steps
    for group in built.environment.groups:
        assert outputs[0].extras[group.name].shape == (SIZE, 5, group.size)
        assert np.isfinite(outputs[-1].extras[group.name]).all()


def test_a_fall_ends_every_objective_with_its_reward(built, steps):
    step, states, _ = steps
    state = states[0]
    for _ in range(60):  # knees to their limit: the body drops
        action = jnp.zeros((SIZE, 28)).at[:, 18:].set(1.0)
        state, output = step(built.world, state, action)
        fallen = np.asarray(output.terminated)
        assert_allclose(output.reward[fallen], -1.0)
        assert_allclose(output.reward[~fallen], 0.0)
        if fallen.any():
            break
    assert fallen.any()
    # the new episodes start along the clip again
    assert (np.asarray(state.step)[fallen] == 0).all()
    assert (np.asarray(state.physics.kinematics.link_position)[fallen, 0, 2] > 0.4).all()
    assert (np.asarray(output.final_observation) != np.asarray(output.observation))[fallen].any()


def test_an_action_that_is_not_a_number_ends_its_episode(built, steps):
    step, states, _ = steps
    action = jnp.zeros((SIZE, 28)).at[1, 4].set(jnp.nan)
    state, output = step(built.world, states[0], action)
    expected = np.arange(SIZE) == 1
    np.testing.assert_array_equal(output.ended["not_finite"], expected)
    np.testing.assert_array_equal(output.terminated, expected)
    assert_allclose(output.reward[1], -1.0)
    assert np.isfinite(output.final_observation).all()
    _, output = step(built.world, state, jnp.zeros((SIZE, 28)))
    assert not output.terminated.any()


def test_episodes_are_cut_after_their_time(built, steps):
    _, states, _ = steps
    env = dataclasses.replace(
        built.environment, config=dataclasses.replace(built.environment.config, episode_s=0.1)
    )
    state = states[0].replace(step=jnp.arange(SIZE) % 3)
    _, output = jax.jit(env.step)(built.world, state, jnp.zeros((SIZE, 28)))
    ended = np.asarray(output.truncated | output.terminated)
    assert (ended == (np.arange(SIZE) % 3 == 2)).all()
    assert not (output.truncated & output.terminated).any()


def test_action_zero_is_the_mean_pose_of_each_groups_clips(built, character):
    world, found = built.world, clips(character)
    centre = np.asarray(world.target_centre)
    arm, knee = character.joint("arm_r_abd"), character.joint("shin_l_flex")
    assert_allclose(centre[arm], 2.0, atol=1e-6)
    assert_allclose(centre[knee], found["lower"][0].qpos[:, 7 + knee].mean(), atol=1e-6)
    ranges = character.joint_upper - character.joint_lower
    assert_allclose(world.target_scale, ranges, rtol=1e-6)
    neutral = dataclasses.replace(built.environment.config, action_centre="neutral")
    assert_allclose(action_centre(neutral, character, found), character.neutral_qpos[7:])


def test_clips_at_another_rate(character):
    clip = clips(character)["lower"][0]
    slow = resampled(clip, 20.0)
    assert_allclose(slow.duration, clip.duration)
    assert_allclose(slow.qpos[2], clip.qpos[3], atol=1e-9)
    assert resampled(clip, 30.0) is clip


def test_starts_must_stand(character):
    lying = clips(character)
    clip = lying["lower"][0]
    qpos = clip.qpos.copy()
    qpos[:, 2] = 0.05
    lying["lower"] = [dataclasses.replace(clip, qpos=qpos)]
    with pytest.raises(ConfigError, match=r"groups\.lower\.clips: every frame counts as a fall"):
        assemble_composite(CONFIG, character, lying, lambda text: None)


def test_goals_join_the_observation_the_rewards_and_the_counts(character):
    composite = dataclasses.replace(
        CONFIG.composite,
        goals={"target_location": {"time": [0.15, 0.15], "radius_m": 0.3, "turn": 0.5}},
    )
    built = tiny_composite(character, dataclasses.replace(CONFIG, composite=composite))
    env, world = built.environment, built.world
    assert env.objectives == ("upper", "lower", "target_location")
    assert env.num_objectives == 3
    state = jax.jit(env.init, static_argnums=2)(world, jax.random.key(0), SIZE)
    assert state.observation.shape == (SIZE, env.observation_size)
    step = jax.jit(env.step)
    # 0.15 s at 1.2 m/s or more is inside the radius, so every attempt of a standing body succeeds
    for _ in range(6):
        state, output = step(world, state, jnp.zeros((SIZE, env.action_size)))
        going = ~np.asarray(output.terminated)
        assert_allclose(output.reward[going, :2], 0.0)
        assert (np.asarray(output.reward)[going, 2] > 0.0).all()
    assert float(state.attempts.max()) >= 1.0
    share = np.asarray(env.success(state)["success_target_location"])
    assert_allclose(share[np.isfinite(share)], 1.0)


def test_staggered_episodes_are_at_different_steps(built, steps):
    _, states, _ = steps
    env = built.environment
    last = round(env.config.episode_s / env.engine.control_dt)
    step = np.asarray(env.stagger(states[0], jax.random.key(1)).step)
    assert len(np.unique(step)) > SIZE // 2
    assert ((step >= 0) & (step < last)).all()


def test_a_goals_mistake_names_its_key(character):
    composite = dataclasses.replace(CONFIG.composite, goals={"target_locaton": {}})
    with pytest.raises(ConfigError, match=r"composite\.goals: .*target_location"):
        tiny_composite(character, dataclasses.replace(CONFIG, composite=composite))


def test_actions_move_a_hinge_as_much_as_its_clips_do(character):
    config = dataclasses.replace(CONFIG.composite, action_range="clips", action_scale=0.5)
    found = action_scale(config, character, clips(character))
    knee = clips(character)["lower"][0].qpos[:, 7 + character.joint("shin_l_flex")]
    assert_allclose(found[character.joint("shin_l_flex")], 0.5 * (0.6 + 4 * knee.std()))
    # still in its own group's clip; that it moves in the other's does not count
    assert_allclose(found[character.joint("arm_l_flex")], 0.3)
    full = character.joint_upper - character.joint_lower
    assert np.all(found <= 0.5 * full + 1e-9)
    whole = action_scale(CONFIG.composite, character, clips(character))
    assert_allclose(whole, full)


def test_mixed_starts_look_like_the_clips_of_every_group(character):
    """In windows too; without, the arms start where the clip of the legs has them."""
    composite = dataclasses.replace(CONFIG.composite, start_mixed=True)
    mixed = tiny_composite(character, dataclasses.replace(CONFIG, composite=composite))
    for built, same in ((mixed, True), (tiny_composite(character), False)):
        env, references = built.environment, built.world.references
        window = env.windows(built.world.starts.history)
        upper = env.groups[0]
        time = jnp.arange(0.0, 1.5, 1 / 60)
        none = jnp.zeros(len(time), jnp.int32)
        clip = window_at(references["upper"], upper, none, time, jnp.full(len(time), 1 / 30))
        gap = jnp.abs(clip[None] - window["upper"][:, None]).max(axis=(2, 3)).min(axis=1)
        assert bool(jnp.max(gap) < 1e-5) is same


def test_what_a_warm_start_learns_is_of_every_groups_clips_wherever_episodes_start(character):
    composite = dataclasses.replace(CONFIG.composite, warm_start=True)
    built = tiny_composite(character, dataclasses.replace(CONFIG, composite=composite))
    knee, arm = character.joint("shin_l_flex"), character.joint("arm_r_abd")
    own = clips(character)["upper"][0].qpos[:, 7 + arm]
    other = clips(character)["lower"][0].qpos[:, 7 + arm]
    assert not np.isclose(own.mean(), other.mean(), atol=0.01)  # or it would show nothing
    # the arms start where the clip of the legs has them
    now = np.asarray(built.world.starts.physics.kinematics.qpos)
    assert_allclose(np.abs(now[:, 7 + arm, None] - other).min(axis=1), 0.0, atol=1e-6)
    row, first = 3, built.following.angles[:, 0, 0]
    assert np.abs(first[row, arm] - own).min() < 1e-3
    assert np.abs(first[row, knee] - now[row, 7 + knee]) < 0.3
