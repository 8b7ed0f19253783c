"""A character that is put somewhere else is the same to its policy; a get-up policy takes over."""

from __future__ import annotations

import dataclasses
import math

import jax
import numpy as np
import pytest
from edit_samples import make_task
from numpy.testing import assert_allclose
from tiny_task import supine

from eval_samples import SMALL, save_policy
from getup_jax.editor.simulate import editor_config
from getup_jax.editor.steer import recovery
from getup_jax.editor.steer.recovery import GetUp
from getup_jax.envs.composite.link_frames import observe
from getup_jax.runtime.checkpoint import load_policy


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


@pytest.fixture(scope="module")
def getup(tmp_path_factory) -> GetUp:
    """An untrained policy that gets up, or rather does not."""
    task = make_task(editor_config(SMALL))
    return GetUp.of(task, load_policy(save_policy(tmp_path_factory.mktemp("up") / "up", task)))


def placed(getup: GetUp, qpos: np.ndarray):
    engine, model = getup.task.environment.engine, getup.task.environment.character.model
    return engine.place(qpos[None], np.zeros((1, model.nv)))


def test_a_getup_policy_goes_on_from_how_the_body_lies(getup):
    qpos = supine(getup.task.environment.character)
    qpos[:2] = 4.0, 1.0
    lying = placed(getup, qpos)
    state = getup.begin(lying)
    assert_allclose(getup.physics(state).kinematics.qpos, lying.kinematics.qpos)
    assert getup.stands(state) is None
    for _ in range(10):
        state = getup.step(state)
    now = np.asarray(getup.physics(state).kinematics.qpos)
    assert_allclose(now[0, :2], [4.0, 1.0], atol=0.5)  # the episode goes on there
    assert getup.stands(state) is None
    episode, _ = state
    late = episode.replace(time=episode.duration + 3.1)
    assert getup.stands((late, 0)) is False


def test_a_body_that_is_up_for_half_a_second_stands(getup):
    state = getup.begin(placed(getup, getup.task.environment.character.neutral_qpos))
    said = []
    for _ in range(15):
        state = getup.step(state)
        said.append(getup.stands(state))
    assert said == [None] * 14 + [True]


def test_it_follows_the_style_that_starts_most_alike(getup):
    clip = getup.task.getups[0]
    turned = dataclasses.replace(clip, points=clip.points + [0.0, -1.0, 0.0])
    both = dataclasses.replace(getup.task, getups=(turned, clip))
    qpos = supine(getup.task.environment.character)[None]
    assert dataclasses.replace(getup, task=both)._style(qpos) == 1
    other = dataclasses.replace(getup.task, getups=(clip, turned))
    assert dataclasses.replace(getup, task=other)._style(qpos) == 0
