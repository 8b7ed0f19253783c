from __future__ import annotations

import re

import numpy as np
import pytest
from bvh_samples import human_bvh, write

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.readers import read_motion
from getup_jax.motion.io.recording import rest_positions, scaled
from getup_jax.motion.retarget.bone_lengths import (
    bone_length,
    guess_unit,
    leg_lengths,
    require_body,
)
from getup_jax.motion.retarget.identify import identify

NOTHING = (0.0, 0.0, 0.0)


def human(tmp_path, *without_length):
    return identify(read_motion(write(tmp_path, human_bvh(dict.fromkeys(without_length, NOTHING)))))


def test_lengths_are_those_of_the_zero_pose(tmp_path):
    recording, links = human(tmp_path, "LeftFoot")
    rest = rest_positions(recording)
    assert bone_length(rest, links, "arm_l", "forearm_l") == pytest.approx(28)
    assert bone_length(rest, links, "shin_l", "foot_l") == 0
    np.testing.assert_allclose(leg_lengths(rest, links, "l"), [42, 0])
    np.testing.assert_allclose(leg_lengths(rest, links, "r"), [42, 41])


@pytest.mark.parametrize("without", [(), ("LeftFoot",), ("LeftLeg",)])
@pytest.mark.parametrize("unit", [1.0, 0.01, 0.001])
def test_the_unit_is_that_of_an_adult_s_leg_or_of_the_half_of_it(tmp_path, without, unit):
    recording, links = human(tmp_path, *without)
    assert guess_unit(scaled(recording, 0.01 / unit), links) == unit


def test_a_body_with_all_its_bones_goes_through_as_it_is(tmp_path):
    recording, links = human(tmp_path)
    assert require_body(recording, links) is recording


@pytest.mark.parametrize(
    ("without", "places"),
    [
        (("LeftFoot",), r"LeftLeg to LeftFoot; .* places foot_l,"),
        (("RightLeg", "LeftHand"), r"LeftForeArm to LeftHand, RightUpLeg to RightLeg; .*"),
        (("LeftForeArm",), r"LeftArm to LeftForeArm; .* places forearm_l,"),
    ],
)
def test_limbs_bones_without_length_are_a_warning_that_names_the_joints(tmp_path, without, places):
    recording, links = human(tmp_path, *without)
    (warning,) = require_body(recording, links).warnings
    assert re.match(f"bones without length: {places}", warning)


@pytest.mark.parametrize(
    ("without", "joints"),
    [
        (("LeftUpLeg", "RightUpLeg"), "LeftUpLeg and RightUpLeg"),
        (("RightLeg", "RightFoot"), "RightUpLeg, RightLeg and RightFoot"),
    ],
)
def test_a_body_that_cannot_be_built_names_the_joints(tmp_path, without, joints):
    recording, links = human(tmp_path, *without)
    with pytest.raises(MotionError, match=f"take: joints {joints} are at one place .* --names$"):
        require_body(recording, links)
