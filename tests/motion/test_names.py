from __future__ import annotations

import pytest

from getup_jax.motion.clips import MotionError
from getup_jax.motion.retarget.joint_names import map_names, read_map, require_links, unknown_joints

LAFAN = ["Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe", "Spine", "Spine1", "Spine2"]
LAFAN += ["Neck", "Head", "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand"]
LAFAN += ["RightShoulder", "RightArm"]
PARENTS = [-1, 0, 1, 2, 3, 0, 5, 6, 7, 8, 7, 10, 11, 12, 7, 14]


def links(joints, parents, user=None):
    return {link: joints[i] for link, i in map_names(joints, parents, user).items()}


def test_lafan1_names():
    found = links(LAFAN, PARENTS)
    expected = {
        "pelvis": "Hips",
        "spine_low": "Spine",
        "spine_mid": "Spine1",
        "spine_upper": "Spine2",
        "thigh_l": "LeftUpLeg",
        "shin_l": "LeftLeg",
        "toe_l": "LeftToe",
        "shoulder_l": "LeftShoulder",
        "arm_l": "LeftArm",
        "forearm_l": "LeftForeArm",
    }
    assert expected.items() <= found.items()


@pytest.mark.parametrize(
    ("joint", "link"),
    [
        ("mixamorig:LeftUpLeg", "thigh_l"),
        ("UpperLeg_L", "thigh_l"),
        ("right_lower_arm", "forearm_r"),
        ("lfemur", "thigh_l"),
        ("RightForeArm", "forearm_r"),
        ("thigh_r", "thigh_r"),
        ("right_elbow", "forearm_r"),
        ("lclavicle", "shoulder_l"),
    ],
)
def test_ways_to_name_a_limb(joint, link):
    joints = ["root", joint, "LeftArm" if "Shoulder" in joint or "clav" in joint else "x"]
    assert map_names(joints, [-1, 0, 1])[link] == 1


def test_without_a_clavicle_the_shoulder_is_the_upper_arm():
    found = links(["root", "chest", "left_shoulder", "left_elbow"], [-1, 0, 1, 2])
    assert found["arm_l"] == "left_shoulder"
    assert found["spine_upper"] == "chest"
    assert "shoulder_l" not in found


def test_a_user_map_wins_and_can_ignore_a_joint():
    user = {"Hips": "pelvis", "Spine": None, "Head": "neck"}
    found = links(LAFAN, PARENTS, user)
    assert found["neck"] == "Head"
    assert "Spine" not in found.values()


def test_a_map_of_a_joint_that_is_not_there():
    with pytest.raises(MotionError, match="no joints Tail"):
        map_names(LAFAN, PARENTS, {"Tail": "pelvis"})


def test_missing_links_list_the_unknown_joints_and_the_way_out():
    joints = ["Koerper", "Bein"]
    found = map_names(joints, [-1, 0])
    assert unknown_joints(joints, found) == joints
    with pytest.raises(MotionError, match=r"f\.bvh: no joint found for pelvis.*Bein.*--names MAP"):
        require_links("f.bvh", joints, found)


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_map_files(tmp_path, suffix):
    file = tmp_path / f"map{suffix}"
    file.write_text('{"Hips": "pelvis", "Tail": null}')
    assert read_map(file) == {"Hips": "pelvis", "Tail": None}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- a\n", "expected lines such as"),
        ("a: tail\n", "unknown links tail"),
        ("a: [", "readable"),
        ("[" * 5000, "readable name map: nested more than 40 deep"),
        ("a: " + "1" * 5000, "readable name map: '11+...1+' cannot be read as int"),
        ("a: b\0", "readable name map: not text"),
    ],
)
def test_bad_map_files(tmp_path, text, message):
    file = tmp_path / "map.yaml"
    file.write_text(text)
    with pytest.raises(MotionError, match=message) as caught:
        read_map(file)
    assert "\n" not in str(caught.value)


def test_a_json_map_that_is_nested_too_deep(tmp_path):
    file = tmp_path / "map.json"
    file.write_text("[" * 100_000)
    with pytest.raises(MotionError, match="not a readable name map"):
        read_map(file)
