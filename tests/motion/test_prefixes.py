from __future__ import annotations

import pytest
from bvh_samples import NAMES

from getup_jax.motion.retarget.joint_names import map_names
from getup_jax.motion.retarget.name_prefixes import without_prefix

LEFT = [name for name in NAMES if name.startswith("Left")]


@pytest.mark.parametrize("prefix", ["rig:", "rig", "Rig1_", "Bip001 ", "scene:rig:"])
def test_a_shared_prefix_is_taken_off(prefix):
    found = without_prefix([prefix + name for name in NAMES], 11)
    assert found[0] == [prefix + name for name in NAMES]
    assert list(NAMES) in found


@pytest.mark.parametrize("suffix", ["_jnt", " (1)", "-bone", ".001"])
def test_a_shared_suffix_is_taken_off(suffix):
    assert list(NAMES) in without_prefix([name + suffix for name in NAMES], 11)
    assert set(links([name + suffix for name in NAMES])) == set(links(list(NAMES)))


def test_few_joints_share_no_prefix():
    assert without_prefix(["a:Hips", "a:Spine", "Camera"], 11) == [["a:Hips", "a:Spine", "Camera"]]


def test_joints_without_the_prefix_keep_their_names():
    names = [*(f"Bip01 {name}" for name in NAMES), "Bip01", "Ponytail1", "Footsteps"]
    expected = [*NAMES, "Bip01", "Ponytail1", "Footsteps"]
    assert expected in without_prefix(names, 11)


def links(names):
    parents = [-1] * len(names)
    return {link: names[joint] for link, joint in map_names(names, parents).items()}


def test_a_side_that_all_joints_end_in_is_no_suffix():
    names = [f"{name.removeprefix('Left')}_L" for name in LEFT]
    names += ["Thumb_L", "Index_L", "Middle_L", "Ring_L"]
    assert links(names)["thigh_l"] == "UpLeg_L"


def test_a_side_that_all_joints_begin_with_is_no_prefix():
    names = [*LEFT, "LeftThumb", "LeftIndex", "LeftMiddle", "LeftRing"]
    found = links(names)
    assert found["thigh_l"] == "LeftUpLeg"
    assert "thigh_r" not in found
    assert links([name.replace("Left", "L") for name in names])["thigh_l"] == "LUpLeg"


def test_no_prefix_goes_without_a_gain():
    names = [f"L{name}" if name in ("Hips", "Head") else name for name in NAMES]
    assert links(names) == links(list(names))
    assert set(links([f"L_{name}" for name in NAMES])) == set(links(list(NAMES)))


def test_many_long_names_cost_little():
    names = [f"group{'_'.join(str(i))}_{'x' * 5000}" for i in range(500)]
    assert len(without_prefix(names, 11)) <= 22
