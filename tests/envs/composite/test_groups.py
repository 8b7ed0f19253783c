from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from tiny_composite import COMPOSITE, CONFIG, GROUPS

from getup_jax.config import ConfigError, GroupConfig
from getup_jax.envs.composite.groups import objective_weights, resolve_groups
from getup_jax.physics.character import load_character


@pytest.fixture(scope="module")
def character():
    return load_character(CONFIG.physics)


def _with(**groups: GroupConfig):
    return dataclasses.replace(COMPOSITE, groups=groups)


def _names(group, character):
    return {character.link_names[i] for i in group.links}


def test_presets_split_the_body(character):
    upper, lower = resolve_groups(COMPOSITE, character)
    assert _names(upper, character) >= {"torso", "head", "arm_l", "hand_r"}
    assert _names(lower, character) == {
        *("pelvis", "thigh_l", "thigh_r", "shin_l", "shin_r", "foot_l", "foot_r"),
    }
    arms, rest = resolve_groups(
        _with(arms=GroupConfig(links=("arms",)), rest=GroupConfig(links=("rest",))), character
    )
    assert len(arms.links) + len(rest.links) == len(character.link_names)
    arm, others = (GroupConfig(links=x) for x in (("right_arm",), ("rest", "left_arm")))
    right, _ = resolve_groups(_with(arm=arm, others=others), character)
    assert _names(right, character) == {"arm_r", "forearm_r", "hand_r"}
    (full,) = resolve_groups(_with(full=GroupConfig(links=("full",))), character)
    assert full.links == tuple(range(len(character.link_names)))


def test_presets_cover_the_other_character():
    from getup_jax.config import PhysicsConfig

    character = load_character(PhysicsConfig())
    upper, lower = resolve_groups(COMPOSITE, character)
    assert len(upper.links) + len(lower.links) == len(character.link_names)


def test_mistakes_name_the_key_and_the_choices(character):
    both = GroupConfig(links=("full",))
    with pytest.raises(ConfigError, match=r"torso.*more than one group.*shared_links"):
        resolve_groups(_with(a=both, b=GROUPS["upper"]), character)
    with pytest.raises(ConfigError, match=r"pelvis.*in no group.*free_links"):
        resolve_groups(_with(upper=GROUPS["upper"]), character)
    wrong = GroupConfig(links=("uper",))
    with pytest.raises(ConfigError, match=r"groups\.a\.links: 'uper'.*'upper'.*thigh_l"):
        resolve_groups(_with(a=wrong), character)
    with pytest.raises(ConfigError, match=r"groups\.a\.links: expected links or a preset"):
        resolve_groups(_with(a=GroupConfig()), character)


def test_overlap_and_rest_may_be_said(character):
    config = dataclasses.replace(
        COMPOSITE,
        groups={"a": GroupConfig(links=("upper",)), "b": GroupConfig(links=("torso",))},
        shared_links=("torso",),
        free_links=("lower",),
    )
    assert len(resolve_groups(config, character)) == 2


def test_weights_of_objectives():
    config = dataclasses.replace(COMPOSITE, weights={"b": 0.75, "a": 0.25})
    assert objective_weights(config, ("a", "b")) == (0.25, 0.75)
    assert objective_weights(COMPOSITE, ("a", "b")) == (0.5, 0.5)
    wrong = dataclasses.replace(COMPOSITE, weights={"a": 0.5, "b": 0.6})
    with pytest.raises(ConfigError, match=r"composite\.weights: .*sum to 1, got 1\.1"):
        objective_weights(wrong, ("a", "b"))
    with pytest.raises(ConfigError, match=r"composite\.weights: expected one of each of a, c"):
        objective_weights(wrong, ("a", "c"))


@pytest.mark.parametrize("frame", ["heading", "root"])
def test_windows_do_not_see_place_and_heading(character, frame):
    group = dataclasses.replace(resolve_groups(COMPOSITE, character)[0], frame=frame)
    rng = np.random.default_rng(0)
    links = len(character.link_names)
    position = rng.normal(size=(5, links, 3))
    turns = Rotation.random(5 * links, random_state=1)
    quaternion = turns.as_quat(scalar_first=True).reshape(5, links, 4)
    yaw = Rotation.from_rotvec([0.0, 0.0, 2.0])
    moved = yaw.apply(position.reshape(-1, 3)).reshape(position.shape)
    moved = moved + np.array([3.0, -2.0, 0.0])
    turned = (yaw * turns).as_quat(scalar_first=True).reshape(quaternion.shape)
    see = jax.jit(group.window)
    one, two = see(position, quaternion), see(moved, turned)
    assert one.shape == (5, group.size)
    assert_allclose(one, two, atol=2e-5)


def test_root_frame_is_that_of_each_moment(character):
    """A body that only translates looks the same in all frames of a `root` window."""
    upper, _ = resolve_groups(COMPOSITE, character)
    rng = np.random.default_rng(0)
    pose = rng.normal(size=(len(character.link_names), 3))
    position = pose + np.arange(5)[:, None, None] * [0.1, 0.0, 0.02]
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (5, len(pose), 1))
    window = jax.jit(upper.window)(position, quaternion)
    assert_allclose(window, np.tile(window[0], (5, 1)), atol=1e-5)
    heading = dataclasses.replace(upper, frame="heading")
    seen = np.asarray(heading.positions(jax.jit(heading.window)(position, quaternion)))
    expected = np.broadcast_to([0.1, 0.0, 0.02], (4, len(upper.links), 3))
    assert_allclose(np.diff(seen, axis=0), expected, atol=1e-5)
