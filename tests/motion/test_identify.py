from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from bvh_samples import BASE, NAMES, write

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.readers import read_motion
from getup_jax.motion.retarget.identify import identify


@pytest.fixture
def human(tmp_path):
    return read_motion(write(tmp_path, BASE))


def joined(first, second):
    """Both skeletons in one recording."""
    shift = len(first.joint_names)
    return dataclasses.replace(
        first,
        joint_names=first.joint_names + second.joint_names,
        parents=first.parents + tuple(p + shift if p >= 0 else -1 for p in second.parents),
        offsets=np.concatenate([first.offsets, second.offsets]),
        translations=np.concatenate([first.translations, second.translations], axis=1),
        rotations=np.concatenate([first.rotations, second.rotations], axis=1),
        ends=first.ends | {joint + shift: end for joint, end in second.ends.items()},
    )


def renamed(recording, **names):
    """The recording with other names for some joints."""
    found = tuple(names.get(name, name) for name in recording.joint_names)
    return dataclasses.replace(recording, joint_names=found)


def prop(human, *names):
    """Joints without limbs, the first the parent of the others."""
    parents = (-1, *[0] * (len(names) - 1))
    index = list(range(len(names)))
    return dataclasses.replace(
        human,
        joint_names=names,
        parents=parents,
        offsets=human.offsets[index],
        translations=human.translations[:, index],
        rotations=human.rotations[:, index],
        ends={},
    )


@pytest.mark.parametrize("first", [True, False])
def test_the_skeleton_with_the_limbs_is_the_body(human, first):
    sword = prop(human, "Sword", "Tip")
    both = joined(human, sword) if first else joined(sword, human)
    body, links = identify(both)
    assert body.joint_names == human.joint_names
    assert links == identify(human)[1]
    assert body.ends.keys() == human.ends.keys()
    np.testing.assert_array_equal(body.rotations, human.rotations)
    assert body.warnings[-1].endswith("under ROOT Hips is used; left out: Sword (2 joints)")


def test_of_two_people_the_first_is_taken(human):
    body, _ = identify(joined(human, renamed(human, Hips="Hips2")))
    assert body.joint_names == human.joint_names
    assert "left out: Hips2 (22 joints)" in body.warnings[-1]


def test_a_map_may_name_joints_of_what_is_left_out(human):
    both = joined(human, prop(human, "Sword"))
    assert identify(both, {"Sword": None})[1] == identify(human)[1]
    with pytest.raises(MotionError, match="no joints Shield"):
        identify(both, {"Shield": None})


def test_a_body_under_two_roots_is_no_body(human):
    parents = list(human.parents)
    parents[human.joint("LeftUpLeg")] = -1
    with pytest.raises(MotionError, match="joint LeftUpLeg does not hang under ROOT Hips"):
        identify(dataclasses.replace(human, parents=tuple(parents)))


def test_a_name_that_comes_twice_is_left_out_where_no_link_needs_it(human):
    body, links = identify(joined(renamed(human, LeftToe="Nub", RightToe="Nub"), prop(human, "x")))
    assert "joints that appear twice are left out: Nub" in body.warnings
    assert "toe_l" not in links


def test_a_name_that_comes_twice_and_is_needed_is_an_error(human):
    with pytest.raises(MotionError, match="joint LeftArm appears twice, and arm_l needs it"):
        identify(joined_at(human, "LeftHand", "LeftArm"))
    with pytest.raises(MotionError, match="joint Spine1 appears twice, and spine_mid needs it"):
        identify(renamed(human, Spine="Spine1"), {"Spine1": "spine_mid"})


def joined_at(human, parent, name):
    """The human with one more joint."""
    more = joined(human, prop(human, name))
    return dataclasses.replace(more, parents=(*human.parents, human.joint(parent)))


def test_vertebrae_of_one_name_are_told_apart_by_their_place(human):
    same = renamed(human, Spine1="Spine", Spine2="Spine")
    body, links = identify(same)
    assert links == identify(human)[1]
    assert body.warnings == ()


def test_a_pelvis_and_a_head_without_a_name_are_found_by_their_place(human):
    body, links = identify(renamed(human, Hips="Becken", Head="Kopf"))
    assert body.joint_names[links["pelvis"]] == "Becken"
    assert body.joint_names[links["head"]] == "Kopf"


def test_what_is_missing_is_listed_and_not_endlessly(human):
    nameless = dataclasses.replace(human, joint_names=tuple(f"j{i}" for i in range(len(NAMES))))
    with pytest.raises(MotionError, match=r"no joint found for pelvis, .*; unknown joints: j0, j1"):
        identify(nameless)
