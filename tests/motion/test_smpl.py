from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from getup_jax.cli.motion import main
from getup_jax.core.resources import asset_path
from getup_jax.motion.authoring.keyframe_clip import clip_from_keyframes
from getup_jax.motion.authoring.keyframe_file import read_keyframes
from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.readers import ReadOptions, is_clip, read_motion
from getup_jax.motion.io.recording import forward
from getup_jax.motion.io.smpl import JOINTS
from getup_jax.motion.library import load_motions
from getup_jax.motion.retarget.body import record
from getup_jax.motion.retarget.joint_names import map_names
from getup_jax.motion.retarget.retarget import RetargetSettings, retarget

# our link of each joint of the model, and how its T-pose becomes our zero pose (degrees about x)
LINKS = {
    **{"pelvis": "pelvis", "spine1": "spine_low", "spine2": "spine_mid", "spine3": "spine_upper"},
    **{"neck": "neck", "head": "head"},
    **{
        f"{side}_{theirs}": f"{ours}_{side[0]}"
        for side in ("left", "right")
        for theirs, ours in (
            *(("hip", "thigh"), ("knee", "shin"), ("ankle", "foot"), ("foot", "foot")),
            *(("collar", "shoulder"), ("shoulder", "arm"), ("elbow", "forearm"), ("wrist", "hand")),
        )
    },
}
ARMS = ("shoulder", "elbow", "wrist")
PARENT = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19]
MODEL = Rotation.from_matrix(
    [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
)  # left, up, front to front, left, up


@pytest.fixture(scope="module")
def clip(character):
    motion = read_keyframes(asset_path("motions", "supine_bridge_half_kneel.yaml"), character)
    return clip_from_keyframes(motion, character)


@pytest.fixture(scope="module")
def arrays(clip, character):
    """The clip as AMASS has it: rotation vectors of 52 joints, Z up."""
    world = forward(record(clip, character))[1]
    turns = []
    for joint in JOINTS:
        link = world[:, character.link(LINKS[joint])]
        side = 1 if joint.startswith("left") else -1
        bent = any(part in joint for part in ARMS)
        down = Rotation.from_euler("x", -90 * side if bent else 0, degrees=True)
        turns.append(Rotation.from_matrix(link) * down * MODEL)
    poses = np.zeros((len(clip.qpos), 156))
    for index, parent in enumerate(PARENT):
        local = turns[index] if parent < 0 else turns[parent].inv() * turns[index]
        poses[:, 3 * index : 3 * index + 3] = local.as_rotvec()
    trans = clip.qpos[:, :3] + [0.3, 0.2, 0.24]
    return {"poses": poses, "trans": trans, "mocap_framerate": 30.0, "betas": np.zeros(16)}


def written(folder, arrays, **changes):
    file = folder / "walk.npz"
    kept = {name: value for name, value in (arrays | changes).items() if value is not None}
    np.savez(file, gender=np.array("neutral"), **kept)
    return file


def distance(one, other) -> float:
    """Mean distance (m) of links, each motion about its own mean place."""
    position = [forward(x)[0] for x in (one, other)]
    position = [p - p[:, :1] for p in position]
    return float(np.linalg.norm(position[0] - position[1], axis=-1).mean())


def y_up(arrays):
    """The same body where y is up."""
    turn = Rotation.from_euler("x", -90, degrees=True)
    poses = arrays["poses"].copy()
    poses[:, :3] = (turn * Rotation.from_rotvec(poses[:, :3])).as_rotvec()
    return {"poses": poses, "trans": turn.apply(arrays["trans"])}


@pytest.mark.parametrize("kind", ["smplh", "smplx", "smpl", "y up", "parts", "three", "no trans"])
def test_a_motion_of_ours_comes_back(tmp_path, arrays, clip, character, kind):
    poses = arrays["poses"]
    changes = {
        "smplh": {},
        "smplx": {"poses": np.pad(poses, ((0, 0), (0, 9)))},
        "smpl": {"poses": poses[:, :72], "fps": 30, "mocap_framerate": None},
        "y up": y_up(arrays),
        "parts": {"poses": None, "root_orient": poses[:, :3], "pose_body": poses[:, 3:66]},
        "three": {"poses": poses.reshape(len(poses), -1, 3)},
        "no trans": {"trans": None},
    }[kind]
    recording = read_motion(written(tmp_path, arrays, **changes))
    found, report = retarget(recording, character, RetargetSettings())
    assert report.position_error_m < 0.01
    assert distance(record(found, character), record(clip, character)) < 0.02
    if kind != "no trans":
        moved = found.qpos[:, :3] - clip.qpos[:, :3]
        np.testing.assert_allclose(moved - moved.mean(axis=0), 0.0, atol=0.06)
        np.testing.assert_allclose(moved[:, 2], 0.0, atol=0.04)
    else:
        assert any("no trans" in text for text in report.warnings)


def test_a_body_upside_down_is_said(tmp_path, arrays):
    """As cameras see it, with y down: it stands along -y."""
    standing = {name: arrays[name][-30:] for name in ("poses", "trans")}
    changes = y_up(standing)
    flip = Rotation.from_euler("x", 180, degrees=True)
    changes["poses"][:, :3] = (flip * Rotation.from_rotvec(changes["poses"][:, :3])).as_rotvec()
    file = written(tmp_path, arrays, **changes | {"trans": flip.apply(changes["trans"])})
    with pytest.raises(MotionError, match=r"walk\.npz: the body stands along -y, expected y or z;"):
        read_motion(file)


def test_joints_of_the_file_give_the_bones(tmp_path, arrays):
    plain = read_motion(written(tmp_path, arrays))
    position, _ = forward(plain)
    measured = read_motion(written(tmp_path, arrays, joints=1.2 * position))
    np.testing.assert_allclose(measured.offsets[1:], 1.2 * plain.offsets[1:], atol=1e-6)


def test_its_joints_are_our_links():
    found = map_names(JOINTS, PARENT)
    assert {link: JOINTS[joint] for link, joint in found.items()} == {
        **{"toe_l": "left_foot", "toe_r": "right_foot"},
        **{ours: theirs for theirs, ours in LINKS.items() if theirs[-4:] != "foot"},
    }


def test_the_command_and_the_library_take_it(tmp_path, arrays, character, cache):
    file = written(tmp_path, arrays)
    assert not is_clip(file)
    report = tmp_path / "report.json"
    assert main(["import", str(file), "--out", str(tmp_path / "out"), "--json", str(report)]) == 0
    (entry,) = json.loads(report.read_text())
    assert entry["errors"] == []
    clip = tmp_path / "out" / "walk.npz"
    assert is_clip(clip)
    from getup_jax.config import MotionConfig

    library = load_motions(MotionConfig(source=(str(file),), mirror=False), character)
    assert len(library.getups) == 1
    assert library.report[str(file)].position_error_m < 0.01


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"poses": np.zeros((9, 63))}, r"poses: expected frames of 66, 72, 156 or 165 numbers"),
        ({"poses": np.zeros((9, 216))}, r"rotation vectors .*, got \(9, 216\); .*from_matrix"),
        ({"poses": np.zeros((9, 24, 3, 3))}, r"got \(9, 24, 3, 3\); .*from_matrix\(m\)\.as_rotvec"),
        ({"poses": np.zeros((9, 24, 4))}, r"got \(9, 24, 4\); .*from_quat"),
        ({"pose_body": np.zeros((9, 69)), "poses": None, "root_orient": np.zeros((9, 6))}, "3 num"),
        ({"trans": np.zeros((9, 3))}, r"trans: expected \d+ x 3 numbers, got float64 of shape \(9"),
        ({"mocap_framerate": None}, r"expected a rate as mocap_framerate, got none; give .*-fps"),
        ({"mocap_framerate": 0.0}, r"mocap_framerate: expected frames a second, got 0"),
        ({"mocap_framerate": np.zeros(3)}, r"as mocap_framerate, got float64 of shape \(3,\)"),
        ({"mocap_framerate": "fast"}, r"as mocap_framerate, got <U4 of shape \(\)"),
        ({"poses": None, "pose_body": np.zeros((9, 63))}, r"expected poses, or root_orient and"),
        ({"joints": np.zeros((145, 17, 3))}, r"joints: expected at least 22, in the order"),
        ({"poses": np.full((145, 72), np.nan)}, r"poses: frame 0: expected finite numbers"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(tmp_path, arrays, changes, message):
    with pytest.raises(MotionError, match=message) as caught:
        read_motion(written(tmp_path, arrays, **changes))
    assert "\n" not in str(caught.value)


def test_a_rate_may_be_given(tmp_path, arrays):
    file = written(tmp_path, arrays, mocap_framerate=None)
    assert read_motion(file, ReadOptions(fps=60.0)).fps == 60.0


def test_an_archive_of_something_else_is_said(tmp_path, character, capsys):
    np.savez(tmp_path / "a.npz", trans=np.zeros(3), betas=np.zeros(3))
    assert main(["import", str(tmp_path / "a.npz")]) == 1
    assert "or poses, trans and mocap_framerate of SMPL, got ['betas', 'trans']" in (
        " ".join(capsys.readouterr().out.split())
    )
