from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation, Slerp
from tiny_composite import COMPOSITE, CONFIG, squat, wave

from getup_jax.config import ConfigError
from getup_jax.envs.composite.groups import resolve_groups
from getup_jax.envs.composite.reference_windows import (
    link_poses,
    make_references,
    nearest,
    sample,
    travel,
    window_at,
)
from getup_jax.motion.authoring.loops import repeated
from getup_jax.motion.clips import Clip
from getup_jax.physics.character import load_character

DT = 1.0 / 30.0


@pytest.fixture(scope="module")
def character():
    return load_character(CONFIG.physics)


@pytest.fixture(scope="module")
def upper(character):
    return resolve_groups(COMPOSITE, character)[0]


@pytest.fixture(scope="module")
def references(character, upper):
    return make_references([wave(character), squat(character, fps=25.0)], upper, character, DT)


def _slow_window(clip: Clip, group, character, times: np.ndarray) -> np.ndarray:
    """Links interpolated one after the other, in float64, then seen by the group."""
    position, quaternion = link_poses(clip.qpos, character)
    grid = np.arange(len(position)) / clip.fps
    place = np.stack(
        [[np.interp(times, grid, position[:, i, a]) for a in range(3)] for i in range(15)]
    ).transpose(2, 0, 1)
    turn = np.stack(
        [
            Slerp(grid, Rotation.from_quat(quaternion[:, i], scalar_first=True))(times).as_quat(
                scalar_first=True
            )
            for i in range(15)
        ],
        axis=1,
    )
    return np.asarray(group.window(jnp.asarray(place), jnp.asarray(turn)))


@pytest.mark.parametrize(("clip", "start", "speed"), [(0, 0.311, 1.0), (1, 1.234, 0.8)])
def test_windows_inside_jit_equal_numpy(character, upper, references, clip, start, speed):
    window = jax.jit(lambda c, s, p: window_at(references, upper, c, s, p))
    found = window(jnp.asarray([clip]), jnp.asarray([start]), jnp.asarray([speed * DT]))[0]
    source = repeated([wave(character), squat(character, fps=25.0)][clip], 2)
    expected = _slow_window(source, upper, character, start + speed * DT * np.arange(5))
    # neighbouring rotations differ by little, so the straight line is nearly the arc
    assert_allclose(found, expected, atol=2e-4)


def test_samples_stay_inside_the_clips(character, upper, references):
    windows = jax.jit(lambda key: sample(references, upper, key, 512, DT))(jax.random.key(0))
    assert windows.shape == (512, 5, upper.size)
    assert np.isfinite(windows).all()
    gap = np.asarray(nearest(references, upper, windows))
    assert gap.max() < 0.02
    # the wave holds an arm up, the squat none: both clips are drawn, by their duration
    hand = upper.links.index(character.link("hand_r"))
    raised = np.asarray(upper.positions(windows))[:, -1, hand, 2] > 0.4
    assert_allclose(raised.mean(), 1.5 / 3.5, atol=0.07)


def test_pace_scales_the_speed_of_the_links(character, upper):
    """Over a pace of 0.8 to 1.2, so do the steps between two frames."""
    references = make_references([wave(character)], upper, character, DT)
    steps = []
    for speed in ((0.8, 0.8), (1.2, 1.2)):
        group = dataclasses.replace(upper, speed=speed)
        draw = jax.jit(lambda key, group=group: sample(references, group, key, 4096, DT))
        windows = draw(jax.random.key(1))
        move = np.diff(np.asarray(group.positions(windows)), axis=1)
        steps.append(np.linalg.norm(move, axis=-1).mean())
    assert_allclose(steps[1] / steps[0], 1.5, rtol=0.03)


def test_a_pose_of_the_clips_is_at_distance_zero(character, upper, references):
    gap = jax.jit(lambda window: nearest(references, upper, window))
    first = jax.jit(lambda c, s: window_at(references, upper, c, s, s))
    window = first(jnp.asarray([0]), jnp.asarray([0.0]))
    assert_allclose(gap(window), 0.0, atol=1e-5)
    away = np.array(window).reshape(*window.shape[:-1], -1, 7)
    away[..., 0] += 0.3
    assert 0.05 < float(gap(away.reshape(window.shape))[0]) <= 0.3 + 1e-5


def test_travel_is_0_at_rest_and_the_mean_of_the_clips_for_them(character, upper):
    """A root that is carried along x at 1 m/s, seen in the heading frame: each link goes 4 dt."""
    group = dataclasses.replace(upper, frame="heading")
    qpos = np.tile(character.neutral_qpos, (61, 1))
    still = make_references([Clip("still", 30.0, qpos)], group, character, DT)
    qpos = qpos.copy()
    qpos[:, 0] = np.arange(61) * DT
    moving = make_references([Clip("moving", 30.0, qpos)], group, character, DT)
    assert_allclose(still.travel, 0.0, atol=1e-6)
    # the pace of the windows is drawn from .8 to 1.2
    assert_allclose(moving.travel, 4 * DT, rtol=0.02)
    row = jnp.zeros(1, jnp.int32)
    window = window_at(moving, group, row, jnp.zeros(1), jnp.full(1, DT))
    assert_allclose(travel(group, window), 4 * DT, rtol=1e-4)


def test_mistakes_name_the_key(character, upper):
    other = Clip("of another", 30.0, np.zeros((40, 56)))
    with pytest.raises(ConfigError, match=r"groups\.upper\.clips: of another: .*56.*expected 35"):
        make_references([other], upper, character, DT)
    clip = wave(character)
    short = dataclasses.replace(clip, qpos=clip.qpos[:5])
    with pytest.raises(ConfigError, match=r"groups\.upper\.clips: wave: lasts 0\.133 s.*history"):
        make_references([short], upper, character, DT)
    with pytest.raises(ConfigError, match="expected at least one clip"):
        make_references([], upper, character, DT)
