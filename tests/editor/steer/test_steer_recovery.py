"""A character that is put somewhere else is the same to its policy; a get-up policy takes over."""

from __future__ import annotations

import dataclasses
import math

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tiny_task import supine

from getup_jax.editor.steer import recovery
from getup_jax.envs.composite.link_frames import observe


def test_a_moved_episode_is_the_same_in_its_own_frame_and_goes_on_alike(policies):
    player = policies.players[policies.first]
    task = player.task
    state = player.begin(player.world, jax.random.PRNGKey(2))
    place, yaw = np.array([3.0, -2.0]), 2.5
    before = player.env.task_state(state)
    after = recovery.moved(before, task.engine, place, yaw)
    seen = after.physics.kinematics
    assert_allclose(seen.qpos[0, :2], place, atol=1e-6)
    assert 2 * math.atan2(seen.qpos[0, 6], seen.qpos[0, 3]) == pytest.approx(yaw, abs=1e-5)
    assert_allclose(
        observe(after.history[:, 1:]), observe(before.history[:, 1:]), atol=2e-5
    )  # positions, rotations and velocities
    step = jax.jit(task.engine.step)
    target = before.physics.kinematics.qpos[:, 7:]
    for _ in range(5):
        before = before.replace(physics=step(before.physics, target))
        after = after.replace(physics=step(after.physics, target))
    one, two = before.physics.kinematics, after.physics.kinematics
    assert_allclose(one.qpos[:, 7:], two.qpos[:, 7:], atol=1e-3)
    assert_allclose(one.qvel[:, 2:], two.qvel[:, 2:], atol=2e-2)


def test_a_start_at_a_place_that_is_no_number_is_where_it_is(policies):
    player, key = policies.players[policies.first], jax.random.PRNGKey(0)
    usual = recovery.fresh(player, key)
    found = recovery.fresh(player, key, np.array([np.nan, 0.0]), 0.0)
    assert_allclose(player.env.kinematics(found).qpos, player.env.kinematics(usual).qpos)


def pose_of(player, qpos: np.ndarray):
    return qpos[None], np.zeros((1, player.task.character.model.nv))


def test_a_getup_policy_goes_on_from_how_the_body_lies(policies, getup):
    player = policies.players[policies.first]
    lying = supine(player.task.character)
    lying[:2] = 4.0, 1.0
    state = getup.begin(*pose_of(player, lying))
    assert_allclose(getup.pose(state)[0][0], lying, atol=1e-5)
    assert getup.stands(state) is None
    for _ in range(10):
        state = getup.step(state)
    qpos, qvel = getup.pose(state)
    assert_allclose(qpos[0, :2], [4.0, 1.0], atol=0.5)  # the episode goes on there
    placed = player.task.engine.place(qpos, qvel).kinematics  # the body that fell, in its pose
    own = state[0].physics.kinematics
    feet = [c.link("foot_l") for c in (player.task.character, getup.task.environment.character)]
    assert_allclose(placed.link_position[0, feet[0]], own.link_position[0, feet[1]], atol=1e-4)
    assert getup.stands(state) is None
    episode, _ = state
    late = episode.replace(time=episode.duration + 3.1)
    assert getup.stands((late, 0)) is False


def test_a_body_that_is_up_for_half_a_second_stands(policies, getup):
    player = policies.players[policies.first]
    state, said = getup.begin(*pose_of(player, player.task.character.neutral_qpos)), []
    for _ in range(15):
        state = getup.step(state)
        said.append(getup.stands(state))
    assert said == [None] * 14 + [True]


def test_it_follows_the_style_that_starts_most_alike(getup):
    clip = getup.task.getups[0]
    turned = dataclasses.replace(clip, points=clip.points + np.array([0.0, -1.0, 0.0]))
    qpos = supine(getup.task.environment.character)[None]
    for styles, nearest in (((turned, clip), 1), ((clip, turned), 0)):
        task = dataclasses.replace(getup.task, getups=styles)
        assert dataclasses.replace(getup, task=task)._style(qpos) == nearest
