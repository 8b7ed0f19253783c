"""Joint names as the programs and data sets of the field write them."""

from __future__ import annotations

import numpy as np
import pytest
from bvh_samples import BASE, NAMES, body_of, human_bvh, write

from getup_jax.motion.retarget.joint_names import LINKS, map_names

# names of the sample's joints, `{}` for the side, and of the sides
SPINE = ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head")
SIDED = ("Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "Toe")
CONVENTIONS = {
    "Mixamo": (
        [f"mixamorig:{name}" for name in SPINE],
        [f"mixamorig:{{}}{name}" for name in (*SIDED[:-1], "ToeBase")],
        ("Left", "Right"),
    ),
    "Rokoko": (
        ["Hips", "Spine2", "Spine3", "Spine4", "Neck", "Head"],
        [f"{{}}{name}" for name in (*SIDED[:4], "Thigh", "Shin", "Foot", "Toe")],
        ("Left", "Right"),
    ),
    "Xsens MVN in BVH": (
        ["Hips", "Chest", "Chest2", "Chest4", "Neck", "Head"],
        [
            *("{}Collar", "{}Shoulder", "{}Elbow", "{}Wrist"),
            *("{}Hip", "{}Knee", "{}Ankle", "{}Toe"),
        ],
        ("Left", "Right"),
    ),
    "Xsens MVN in FBX": (
        ["Pelvis", "L5", "T12", "T8", "Neck", "Head"],
        [
            *("{}Shoulder", "{}UpperArm", "{}Forearm", "{}Hand"),
            *("{}UpperLeg", "{}LowerLeg", "{}Foot", "{}Toe"),
        ],
        ("Left", "Right"),
    ),
    "CMU by cgspeed, MotionBuilder": (
        ["Hips", "LowerBack", "Spine", "Spine1", "Neck1", "Head"],
        [f"{{}}{name}" for name in (*SIDED[:-1], "ToeBase")],
        ("Left", "Right"),
    ),
    "CMU by cgspeed, Daz": (
        ["hip", "abdomen", "spine", "chest", "neck", "head"],
        [
            *("{}Collar", "{}Shldr", "{}ForeArm", "{}Hand"),
            *("{}Thigh", "{}Shin", "{}Foot", "{}Toe"),
        ],
        ("l", "r"),
    ),
    "Bandai-Namco": (
        ["Hips", "Spine", "Spine1", "Chest", "Neck", "Head"],
        [
            *("Shoulder_{}", "UpperArm_{}", "LowerArm_{}", "Hand_{}"),
            *("UpperLeg_{}", "LowerLeg_{}", "Foot_{}", "Toes_{}"),
        ],
        ("L", "R"),
    ),
    "LAFAN1": (list(SPINE), [f"{{}}{name}" for name in SIDED], ("Left", "Right")),
    "SMPL add-ons": (
        ["Pelvis", "Spine1", "Spine2", "Spine3", "Neck", "Head"],
        [
            *("{}_Collar", "{}_Shoulder", "{}_Elbow", "{}_Wrist"),
            *("{}_Hip", "{}_Knee", "{}_Ankle", "{}_Foot"),
        ],
        ("L", "R"),
    ),
    "Biped": (
        [f"Bip01 {n}" for n in ("Pelvis", "Spine", "Spine1", "Spine2", "Neck", "Head")],
        [
            *("Bip01 {} Clavicle", "Bip01 {} UpperArm", "Bip01 {} Forearm", "Bip01 {} Hand"),
            *("Bip01 {} Thigh", "Bip01 {} Calf", "Bip01 {} Foot", "Bip01 {} Toe0"),
        ],
        ("L", "R"),
    ),
    "Unreal": (
        ["pelvis", "spine_01", "spine_02", "spine_03", "neck_01", "head"],
        [
            *("clavicle_{}", "upperarm_{}", "lowerarm_{}", "hand_{}"),
            *("thigh_{}", "calf_{}", "foot_{}", "ball_{}"),
        ],
        ("l", "r"),
    ),
    "VRM": (
        ["hips", "spine", "chest", "upperChest", "neck", "head"],
        [
            *("{}Shoulder", "{}UpperArm", "{}LowerArm", "{}Hand"),
            *("{}UpperLeg", "{}LowerLeg", "{}Foot", "{}Toes"),
        ],
        ("left", "right"),
    ),
}


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_file_with_these_names_is_the_same_motion(tmp_path, convention):
    middle, sided, sides = CONVENTIONS[convention]
    names = dict(zip(SPINE, middle, strict=True))
    for ours, side in zip(("Left", "Right"), sides, strict=True):
        named = (name.format(side) for name in sided)
        names |= dict(zip((f"{ours}{name}" for name in SIDED), named, strict=True))
    assert names.keys() == {*NAMES}
    text = human_bvh(rename=lambda name: names[name])
    found, _ = body_of(write(tmp_path, text))
    expected, _ = body_of(write(tmp_path, BASE, "base.bvh"))
    assert found.keys() == expected.keys() == {*LINKS}
    for link, values in expected.items():
        np.testing.assert_allclose(found[link], values, atol=1e-9, err_msg=link)


# whole trees, with the joints that no link needs: name and parent
CGSPEED = [
    *(("Hips", ""), ("LowerBack", "Hips"), ("Spine", "LowerBack"), ("Spine1", "Spine")),
    *(("Neck", "Spine1"), ("Neck1", "Neck"), ("Head", "Neck1")),
    *(
        (name.format(side, side[0]), parent.format(side, side[0]))
        for side in ("Left", "Right")
        for name, parent in (
            *(("{1}HipJoint", "Hips"), ("{0}UpLeg", "{1}HipJoint"), ("{0}Leg", "{0}UpLeg")),
            *(("{0}Foot", "{0}Leg"), ("{0}ToeBase", "{0}Foot"), ("{0}Shoulder", "Spine1")),
            *(("{0}Arm", "{0}Shoulder"), ("{0}ForeArm", "{0}Arm"), ("{0}Hand", "{0}ForeArm")),
            *(("{0}FingerBase", "{0}Hand"), ("{0}HandIndex1", "{0}FingerBase")),
            ("{1}Thumb", "{0}Hand"),
        )
    ),
]
BANDAI = [
    *(("joint_Root", ""), ("Hips", "joint_Root"), ("Spine", "Hips"), ("Chest", "Spine")),
    *(("Neck", "Chest"), ("Head", "Neck")),
    *(
        (name.format(side), parent.format(side))
        for side in "LR"
        for name, parent in (
            *(("Shoulder_{}", "Chest"), ("UpperArm_{}", "Shoulder_{}")),
            *(("LowerArm_{}", "UpperArm_{}"), ("Hand_{}", "LowerArm_{}")),
            *(("UpperLeg_{}", "Hips"), ("LowerLeg_{}", "UpperLeg_{}")),
            *(("Foot_{}", "LowerLeg_{}"), ("Toes_{}", "Foot_{}")),
        )
    ),
]


@pytest.mark.parametrize(
    ("tree", "expected"),
    [
        (
            CGSPEED,
            {"neck": "Neck1", "thigh_l": "LeftUpLeg", "shoulder_r": "RightShoulder"}
            | {"spine_low": "LowerBack", "spine_mid": "Spine", "spine_upper": "Spine1"}
            | {"hand_r": "RightHand", "toe_l": "LeftToeBase"},
        ),
        (
            BANDAI,
            {"pelvis": "Hips", "spine_low": "Spine", "spine_upper": "Chest"}
            | {"arm_l": "UpperArm_L", "shoulder_l": "Shoulder_L", "toe_r": "Toes_R"},
        ),
    ],
)
def test_joints_that_no_link_needs_take_no_link(tree, expected):
    names = [name for name, _ in tree]
    parents = [names.index(parent) if parent else -1 for _, parent in tree]
    found = {link: names[joint] for link, joint in map_names(names, parents).items()}
    assert expected.items() <= found.items()
    assert {*LINKS} - found.keys() <= {"spine_mid"}


def test_an_ankle_that_carries_no_foot_is_left_alone():
    """A foot above a joint called ankle stays the foot."""
    names = ["hips", "left_foot", "left_ankle"]
    assert map_names(names, [-1, 0, 1])["foot_l"] == 1
    assert map_names(names, [-1, 2, 0])["foot_l"] == 2
    assert map_names(names, [-1, 2, 0])["toe_l"] == 1
    assert map_names(names, [-1, 2, 0], {"left_foot": "foot_l"})["foot_l"] == 1
