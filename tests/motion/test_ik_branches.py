from __future__ import annotations

import numpy as np
import pytest
from motion_samples import getup_clip

from getup_jax.motion.clips import Clip
from getup_jax.motion.getup.events import link_positions
from getup_jax.motion.retarget.ik_branches import nearer_branches

FPS = 30.0


def hinges(character, *names):
    return [7 + character.joint(name) for name in names]


def arm(character, side="r"):
    return hinges(character, *(f"arm_{side}_{hinge}" for hinge in ("flex", "abd", "twist")))


def twin(angles):
    """The other triple of the same rotation, written out."""
    a, b, c = angles
    other = np.array([a + np.pi, np.pi - b, c + np.pi])
    return np.arctan2(np.sin(other), np.cos(other))


def positions(qpos, character):
    return link_positions(Clip("poses", FPS, qpos), character)


@pytest.mark.parametrize("side", ["l", "r"])
def test_a_clip_in_the_far_triple_comes_back_without_a_change_of_pose(character, side):
    near = np.tile(character.neutral_qpos, (40, 1))
    near[:, arm(character, side)] = 0.4, 0.6, -0.3
    far = near.copy()
    far[:, arm(character, side)] = twin(near[0, arm(character, side)])
    assert np.abs(far).max() > 2.5
    np.testing.assert_allclose(positions(far, character), positions(near, character), atol=1e-9)
    np.testing.assert_allclose(nearer_branches(far, character, FPS), near, atol=1e-9)


def test_a_clip_near_rest_stays_as_it_is(character):
    clip = getup_clip(character)
    np.testing.assert_array_equal(nearer_branches(clip.qpos, character, FPS), clip.qpos)


def swing(character):
    """The arm goes up sideways past the singularity, over the head, and down in front for good."""
    count = 120
    up = np.clip(np.linspace(0, 4, count), 0, 1)[:, None]
    down = np.clip(np.linspace(-2, 2, count), 0, 1)[:, None]
    rest, top = np.array([0.0, 0.2, 0.0]), np.array([0.0, 2.9, 0.0])
    end = twin(np.array([0.3, 0.2, 0.1]))
    qpos = np.tile(character.neutral_qpos, (count, 1))
    qpos[:, arm(character)] = rest + up * (top - rest) + down * (end - top)
    return qpos


def test_a_swing_over_the_head_ends_near_rest_and_no_hinge_jumps(character):
    qpos = swing(character)
    assert np.abs(qpos[-1, arm(character)]).max() > 2.5
    mended = nearer_branches(qpos, character, FPS)
    assert np.abs(mended[-1, arm(character)]).max() < 0.5
    assert np.abs(np.diff(mended[:, 7:], axis=0)).max() < 0.5
    moved = np.linalg.norm(positions(mended, character) - positions(qpos, character), axis=-1)
    assert (moved.max(axis=1) > 1e-6).sum() < 20  # only the frames of the change
    others = np.setdiff1d(np.arange(qpos.shape[1]), arm(character))
    np.testing.assert_array_equal(mended[:, others], qpos[:, others])


def test_a_short_visit_to_the_far_triple_is_not_worth_two_changes(character):
    qpos = np.tile(character.neutral_qpos, (60, 1))
    qpos[:, arm(character)] = 0.0, 1.2, 0.0
    qpos[30, arm(character)] = 0.0, 1.9, 0.0  # a little nearer to rest in its twin? no: pi, 1.2, pi
    np.testing.assert_array_equal(nearer_branches(qpos, character, FPS), qpos)


def test_joint_limits_are_kept(character):
    mended = nearer_branches(swing(character), character, FPS)[:, 7:]
    assert (mended >= character.joint_lower).all()
    assert (mended <= character.joint_upper).all()
