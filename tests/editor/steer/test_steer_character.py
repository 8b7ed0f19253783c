"""One character: what it is told, switches while it moves, falls and what comes after them."""

from __future__ import annotations

import dataclasses
import math

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tiny_task import supine

from getup_jax.editor.steer.character import LIES_S, Character

PLACE = {"place": (0.0, 0.0), "within_s": 4.0}


@pytest.fixture
def character(policies):
    return Character(policies.players, None, seed=0)


def lay_down(character: Character, height: float = 0.0) -> None:
    """Put it onto its back at (3, 1), or standing `height` m above the floor."""
    player, body = character._player, character._player.task.character
    pose = supine(body) if height == 0.0 else body.neutral_qpos.copy()
    pose[:3] += [3.0 - pose[0], 1.0 - pose[1], height]
    physics = player.task.engine.place(pose[None], np.zeros((1, body.model.nv)))
    character._adopt(character._episode.replace(physics=physics))


def until(character: Character, phase: str, most: int = 120):
    """The frames up to the first one of that phase."""
    frames = [character.step()]
    while frames[-1].said["phase"] != phase and len(frames) < most:
        frames.append(character.step())
    assert frames[-1].said["phase"] == phase
    return frames


def test_it_begins_at_the_origin_is_told_a_place_and_reaches_it(character, policies):
    first = character.step()
    assert first.links.shape == (15, 7)
    assert_allclose(first.links[0, :2], 0.0, atol=0.1)
    assert first.said["policy"] == policies.first
    goal = first.said["goals"]["target_location"]
    assert goal["told"] is None
    assert 0.0 <= goal["reward"] <= 1.0
    character.order("target_location", PLACE)
    goal = character.step().said["goals"]["target_location"]
    assert goal["told"] == {"order": PLACE, "reached_after_s": pytest.approx(1 / 30)}
    assert goal["markers"][0]["position"] == [0.0, 0.0, 0.0]
    character.order("target_location", {"place": (9.0, 0.0), "within_s": 4.0})
    told = character.step().said["goals"]["target_location"]["told"]
    assert told["reached_after_s"] is None
    character.restart()
    again = character.step()
    assert again.said["time"] == pytest.approx(1 / 30, abs=1e-3)
    assert again.said["goals"]["target_location"]["told"] is None


def test_a_switch_keeps_the_pose_and_the_targets(character, policies):
    walk, aim = policies.asked
    character.order("target_location", {"place": (5.0, 1.0), "within_s": 4.0})
    character.order("aiming", {"yaw_deg": 90.0, "pitch_deg": 0.0})  # for the next policy
    before = character.step()
    assert "aiming" not in before.said["goals"]
    character.switch(aim)
    after = character.step()
    assert after.said["policy"] == aim
    assert np.abs(after.links[0, :3] - before.links[0, :3]).max() < 0.05
    goals = after.said["goals"]
    assert goals["target_location"]["markers"][0]["position"] == [5.0, 1.0, 0.0]
    assert_allclose(goals["aiming"]["markers"][0]["reach"], [0.0, 1.0, 0.0], atol=1e-4)
    character.switch(walk)
    assert character.step().said["policy"] == walk


def test_after_a_fall_it_is_put_back_where_it_fell_and_says_so(character):
    character.order("target_location", PLACE)
    lay_down(character)
    fell = until(character, "lies", 3)[-1]
    assert (fell.said["words"], fell.said["falls"]) == ("It fell", 1)
    assert fell.said["goals"]["target_location"]["reward"] is None
    assert fell.said["on_feet_in_s"] == LIES_S
    frames = until(character, "acts")
    assert len(frames) == round(LIES_S * 30)
    lying = frames[-2].links[0]
    assert lying[2] < 0.3  # it lay, limp
    assert np.abs(np.diff([frame.links[0, 2] for frame in frames[-20:-1]])).max() < 5e-3
    up = frames[-1]
    assert up.said["words"] == "It fell: it was put back on its feet"
    assert up.links[0, 2] > 0.6
    assert_allclose(up.links[0, :2], lying[:2], atol=1e-3)
    assert up.said["goals"]["target_location"]["told"]["order"] == PLACE
    assert character.step().said["phase"] == "acts"


class Lift:
    """Gets it up in ten steps, by standing it there; or does not manage to."""

    def __init__(self, policies, verdict: bool) -> None:
        self.task, self.verdict, self.begun = policies.players[policies.first].task, verdict, 0

    def begin(self, qpos, qvel):
        self.begun += 1
        pose = self.task.character.neutral_qpos.copy()
        pose[:2] = qpos[0, :2]
        return 0, (pose[None], 0.0 * qvel)

    def step(self, state):
        return state[0] + 1, state[1]

    def pose(self, state):
        return state[1]

    def stands(self, state):
        return self.verdict if state[0] == 10 else None


@pytest.mark.parametrize("verdict", [True, False])
def test_a_getup_policy_takes_over_and_hands_back(policies, verdict):
    lift = Lift(policies, verdict)
    character = Character(policies.players, lift, seed=0)
    lay_down(character)
    lies = until(character, "lies", 3)[-1]
    assert lies.said["on_feet_in_s"] is None
    rises = until(character, "rises")
    assert len(rises) in (30, 31)  # a second at rest
    acts = until(character, "acts")
    assert len(acts) == 10
    assert lift.begun == 1
    failed = "It did not manage to stand up: it was put back on its feet"
    assert acts[-1].said["words"] == ("It stood up by itself" if verdict else failed)
    assert_allclose(acts[-1].links[0, :2], [3.0, 1.0], atol=0.3)
    # the policy sees the frames in which it stood, and none of its own before the fall
    history = np.asarray(character._episode.history)[0]
    assert (history[:, 0, 2] > 0.6).all()
    assert character.step().said["goals"]["target_location"]["reward"] is not None


def test_a_getup_policy_of_the_same_body_acts_and_gives_up(policies, getup):
    character = Character(policies.players, getup, seed=0)
    lay_down(character)
    until(character, "rises")
    rises = until(character, "acts", 300)
    assert len(rises) == pytest.approx(30 * (1.0 + 3.0), abs=3)  # its curve, and its patience
    assert "It did not manage to stand up" in rises[-1].said["words"]
    lying = np.array([frame.links[0, :2] for frame in rises])
    assert np.abs(np.diff(lying, axis=0)).max() < 0.2  # one body, that nobody puts elsewhere


def test_a_push_moves_it_away(character):
    character.step()
    before = character._episode.physics.kinematics
    character.push(math.radians(90.0))
    after = character._episode.physics.kinematics
    change = np.asarray(after.link_linear_velocity - before.link_linear_velocity)[0, 0]
    assert change[1] > 1.0
    assert abs(change[0]) < 0.5 * change[1]
    assert_allclose(after.qpos, before.qpos, atol=1e-5)


def test_a_push_while_it_gets_up_lets_it_begin_again(policies):
    character = Character(policies.players, Lift(policies, True), seed=0)
    lay_down(character)
    until(character, "rises")
    character.push(0.0)
    assert len(until(character, "rises")) in (30, 31)
    assert character.step().said["falls"] == 1


def test_a_simulation_that_fails_is_put_back_and_shows_numbers(policies):
    player = policies.players[policies.first]
    broken = jax.tree.map(
        lambda x: np.full_like(x, np.nan) if x.dtype == np.float32 else x, player.policy
    )
    players = {"broken": dataclasses.replace(player, policy=broken)}
    character = Character(players, None, seed=0)
    for _ in range(3):
        frame = character.step()
        assert frame.said["words"] == "The simulation failed: it was put back on its feet"
        assert np.isfinite(frame.links).all()
        assert frame.said["phase"] == "acts"
