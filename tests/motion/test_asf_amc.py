from __future__ import annotations

import numpy as np
import pytest

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.readers import read_motion
from getup_jax.motion.io.recording import forward

ASF = """\
:version 1.10
:root
  order TX TY TZ RX RY RZ
  axis XYZ
:bonedata
  begin
     id 1
     name spine
     direction 0 1 0
     length 2
     axis 0 0 90 XYZ
     dof rx
     limits (-20 20)
  end
  begin
     name head
     direction 0 1 0
     length 1
     axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root spine
    spine head
  end
"""
AMC = """\
#!OML
:FULLY-SPECIFIED
:DEGREES
1
root 0 5 0 0 0 0
spine 0
2
root 0 5 0 0 0 0
spine 90
"""


def write(tmp_path, asf=ASF, amc=AMC):
    (tmp_path / "01.asf").write_text(asf)
    (tmp_path / "01_01.amc").write_text(amc)
    return tmp_path / "01_01.amc"


def test_bones_turn_about_their_own_axes(tmp_path):
    motion = read_motion(write(tmp_path))
    position, _ = forward(motion)
    assert motion.joint_names == ("root", "spine", "head")
    np.testing.assert_allclose(position[0, 2], [0, 0, 7], atol=1e-12)
    # the spine's x axis at rest is the world's y (file): the turn leaves its own direction
    np.testing.assert_allclose(position[1, 2], [0, 0, 7], atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("spine 90", "spine ninety", "line 9, bone spine: expected finite numbers"),
        ("spine 90", "spine 90 1", "line 9, bone spine: expected 1 angles"),
        ("spine 90", "tail 90", "line 9, bone tail"),
        ("spine 90\n", "", r"frame 2: no values for bones \['spine'\]"),
        (AMC, "", "expected frames, got none"),
        ("spine 90", "spine 1e308", "line 9, bone spine: expected finite numbers"),
        ("spine 90", "spine 90\nspine 90", "line 10, bone spine: expected 1 angles, once a frame"),
        (":DEGREES", ":RADIANS", "line 3: expected :DEGREES, got :RADIANS"),
    ],
)
def test_errors_name_the_line_and_the_bone(tmp_path, old, new, message):
    with pytest.raises(MotionError, match=message):
        read_motion(write(tmp_path, amc=AMC.replace(old, new)))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("name spine", "name head", "bone head appears twice"),
        ("direction 0 1 0", "direction 0 1", r"line 9: direction: expected 3 finite numbers"),
        ("length 2", "length", "line 10: length: expected 1 finite numbers, got ''"),
        ("axis 0 0 90 XYZ", "axis 0 0 90 ZYX", "line 11: axis: expected the order XYZ, got 'ZYX'"),
        ("  axis XYZ", "  axis ZYX", "line 4: axis: expected the order XYZ"),
        ("dof rx", "dof rx l", "line 12: dof: expected some of tx, .* got 'rx l'"),
        ("dof rx", "dof rx rx", "line 12: dof: expected some of tx"),
        ("spine head", "head spine", "expected bones with a hierarchy; without parent"),
        ("spine head", "spine tail", r"unknown bones \['tail'\]; known are root, spine, head"),
        (":root", ":units\n  angle rad\n:root", "line 3: angle: expected deg, got 'rad'"),
    ],
)
def test_skeletons_that_would_be_misread_are_refused(tmp_path, old, new, message):
    assert old in ASF
    with pytest.raises(MotionError, match=message) as caught:
        read_motion(write(tmp_path, asf=ASF.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.encode("utf-8-sig"),
        lambda text: text.encode("utf-16"),
        lambda text: text.replace("\n", "\r").encode(),
        lambda text: (text + "\0\0\x1a").encode(),
        lambda text: text.replace("\n", "  # said by hand\n").encode(),
        lambda text: text.replace("\n", "\n\n").encode(),
        lambda text: text.replace("begin", "BEGIN").replace("name ", "Name ").encode(),
        lambda text: text.replace(":hierarchy", ":HIERARCHY").encode(),
    ],
)
def test_other_forms_of_both_files_say_the_same(tmp_path, change):
    expected = read_motion(write(tmp_path))
    file = write(tmp_path)
    file.write_bytes(change(AMC))
    (tmp_path / "01.asf").rename(tmp_path / "01.ASF")
    (tmp_path / "01.ASF").write_bytes(change(ASF))
    found = read_motion(file)
    assert found.joint_names == expected.joint_names
    np.testing.assert_array_equal(found.translations, expected.translations)
    np.testing.assert_array_equal(found.rotations, expected.rotations)


def test_a_missing_skeleton(tmp_path):
    file = write(tmp_path)
    (tmp_path / "01.asf").unlink()
    with pytest.raises(MotionError, match=r"expected its skeleton 01\.asf in the same folder"):
        read_motion(file)


def test_both_formats_of_a_cmu_trial_agree(mocap, tmp_path):
    (tmp_path / "01.asf").write_bytes((mocap / "cmu" / "01.asf").read_bytes())
    lines = (mocap / "cmu" / "01_01.amc").read_text().splitlines()
    end = lines.index("31")
    (tmp_path / "01_01.amc").write_text("\n".join(lines[:end]))
    amc = read_motion(tmp_path / "01_01.amc")
    bvh = read_motion(mocap / "cmu" / "01_01.bvh")
    assert amc.num_frames == 30
    ours, theirs = forward(amc)[0], forward(bvh)[0][1:31]  # the BVH starts with a T-pose
    pairs = {"ltibia": "LeftLeg", "rtoes": "RightToeBase", "thorax": "Spine1"}
    for bone, joint in pairs.items():
        place = ours[:, amc.joint(bone)], theirs[:, bvh.joint(joint)]
        np.testing.assert_allclose(*place, atol=0.01)
    # above the thorax the BVH lacks one bone, so only directions agree there
    way = ours[:, amc.joint("lradius")] - ours[:, amc.joint("lhumerus")]
    other = theirs[:, bvh.joint("LeftForeArm")] - theirs[:, bvh.joint("LeftArm")]
    np.testing.assert_allclose(way, other, atol=0.01)
