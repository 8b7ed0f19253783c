"""Loops played again, and walks bent along arcs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from getup_jax.config import CompositeConfig, ConfigError, GroupConfig, PhysicsConfig
from getup_jax.envs.composite.build import load_clips
from getup_jax.envs.composite.reference_state_init import families
from getup_jax.motion.authoring.contact_ik import Planter
from getup_jax.motion.authoring.loops import is_loop, repeated
from getup_jax.motion.authoring.path_editing import bent
from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.named_clips import named_clips
from getup_jax.physics.character import CharacterSpec, load_character

TURN = 0.8  # rad/s


@pytest.fixture(scope="module")
def character() -> CharacterSpec:
    return load_character(PhysicsConfig(character="humanoid28"))


@pytest.fixture(scope="module")
def walk(character) -> Clip:
    return named_clips(["walk"], character, "clips")[0]


@pytest.fixture(scope="module")
def left(walk, character) -> Clip:
    return bent(walk, TURN, character)


def yaw(clip: Clip) -> np.ndarray:
    """Heading of the root (rad) in each frame, unwrapped."""
    q = clip.qpos[:, 3:7]
    return np.unwrap(2.0 * np.arctan2(q[:, 3], q[:, 0]))


def soles(clip: Clip, character: CharacterSpec) -> np.ndarray:
    """Front and back edges of the soles [F, 4, 3] (m)."""
    planter = Planter(character)
    names = ["toes_l", "heel_l", "toes_r", "heel_r"]
    found = [planter.poses(pose, names) for pose in clip.qpos]
    return np.array([[places[name][:3] for name in names] for places in found])


@pytest.mark.parametrize("times", [2, 3])
def test_a_loop_goes_on_from_where_it_ended(character, times):
    """A walk in a circle: each round starts at the last one's end, turned with it."""
    count, turn = 31, 0.5
    qpos = np.tile(character.neutral_qpos, (count, 1))
    angle = np.linspace(0.0, turn, count)
    qpos[:, 0], qpos[:, 1] = np.sin(angle), 1.0 - np.cos(angle)
    qpos[:, 3:7] = Rotation.from_rotvec([[0, 0, y] for y in angle]).as_quat(scalar_first=True)
    again = repeated(Clip("circle", 30.0, qpos), times).qpos
    assert len(again) == times * (count - 1) + 1
    angle = np.linspace(0.0, times * turn, len(again))
    assert_allclose(again[:, :2], np.stack([np.sin(angle), 1 - np.cos(angle)], 1), atol=1e-9)
    assert_allclose(again[:, 3], np.cos(angle / 2), atol=1e-9)


def test_what_does_not_repeat_is_left_alone(walk):
    half = dataclasses.replace(walk, qpos=walk.qpos[: len(walk.qpos) // 2])
    assert is_loop(walk)
    assert not is_loop(half)
    assert repeated(half, 2) is half


def test_a_bent_loop_turns_at_its_rate_and_stays_a_loop(walk, left, character):
    assert is_loop(left)
    assert len(left.qpos) == len(walk.qpos)
    assert_allclose(yaw(left)[-1] - yaw(left)[0], TURN * walk.duration, atol=1e-3)
    # a chord of the arc that is as long as the straight walk
    length = np.linalg.norm(walk.qpos[-1, :2] - walk.qpos[0, :2])
    chord = np.linalg.norm(left.qpos[-1, :2] - left.qpos[0, :2])
    half = TURN * walk.duration / 2
    # the body sways and leans, so that the root's arc is a little narrower than its path's
    assert_allclose(chord, length * np.sin(half) / half, rtol=0.05)
    # the seam is as smooth as the rest
    rates = np.abs(np.diff(repeated(left, 2).qpos[:, 7:], axis=0)).max(axis=1)
    assert rates[len(left.qpos) - 2 : len(left.qpos)].max() <= 1.2 * rates.max()


def test_feet_stand_where_they_stood(walk, left, character):
    """Edges on the floor go as slowly as in the straight walk, and no foot sinks in."""
    for clip in (walk, left):
        edges = soles(repeated(clip, 2), character)
        assert edges[..., 2].min() > -2e-3
        speed = np.linalg.norm(np.diff(edges[..., :2], axis=0), axis=-1) * clip.fps
        low = edges[1:, :, 2] < 0.01
        slowest = np.min(np.where(low, speed, np.inf), axis=1)
        assert slowest.max() < 0.15


def test_the_body_leans_into_the_turn(walk, left):
    lean = []
    for clip in (walk, left):
        up = Rotation.from_quat(clip.qpos[:, 3:7], scalar_first=True).apply([0.0, 0.0, 1.0])
        side = np.stack([-np.sin(yaw(clip)), np.cos(yaw(clip))], axis=1)
        lean.append(np.degrees(np.arcsin(np.sum(up[:, :2] * side, axis=1))).mean())
    assert_allclose(lean[0], 0.0, atol=0.5)
    assert_allclose(lean[1], np.degrees(np.arctan(1.25 * TURN / 9.81)), atol=1.0)


def test_left_and_right_are_mirror_images(walk, left, character):
    """The walk's second half is the mirror image of its first, and so are the arcs."""
    right, half = bent(walk, -TURN, character), (len(walk.qpos) - 1) // 2
    shin = [7 + character.joint(f"shin_{side}_flex") for side in "lr"]
    assert_allclose(
        left.qpos[:half, shin[0]], right.qpos[half : 2 * half, shin[1]], atol=np.radians(2.0)
    )


def test_zero_is_the_clip_itself(walk, character):
    assert bent(walk, 0.0, character) is walk


def test_a_clip_that_ends_elsewhere_is_bent_as_it_is(walk, character):
    part = dataclasses.replace(walk, qpos=repeated(walk, 2).qpos[: len(walk.qpos) + 8])
    found = bent(part, TURN, character)
    assert found.qpos.shape == part.qpos.shape
    assert np.isfinite(found.qpos).all()
    assert_allclose(yaw(found)[-1] - yaw(found)[0], TURN * part.duration, atol=0.15)


def test_groups_take_their_clips_along_arcs(character):
    group = GroupConfig(links=("full",), clips=("walk",), turns=(-0.5, 0.0, 0.5))
    clips = load_clips(CompositeConfig(groups={"body": group}), character)["body"]
    assert [round(float(np.diff(yaw(c)[[0, -1]])[0]), 2) for c in clips] == [-0.5, 0.0, 0.5]
    assert [len(family) for family in families(clips, group.turns)] == [3]


def test_mistakes_name_the_key(character):
    with pytest.raises(MotionError, match=r"squat: goes 0\.00 m/s, expected at least 0\.2"):
        bent(named_clips(["squat"], character, "clips")[0], 0.5, character)
    group = GroupConfig(links=("full",), clips=("squat",), turns=(0.0, 0.5))
    with pytest.raises(ConfigError, match=r"composite\.groups\.body\.turns: squat: goes"):
        load_clips(CompositeConfig(groups={"body": group}), character)
    for wrong in ((), (3.0,)):
        with pytest.raises(ConfigError, match=r"groups\.\*\.turns.*from -2 to 2"):
            GroupConfig(turns=wrong)
