"""A get-up of a small human skeleton as BVH text, and the ways in which files differ from it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.cli.motion import main
from getup_jax.motion.io.readers import read_motion
from getup_jax.motion.io.recording import Recording
from getup_jax.motion.retarget.axes import shortest_turn
from getup_jax.motion.retarget.cache import read_npz
from getup_jax.motion.retarget.identify import identify

# name, parent, OFFSET (cm, Y up): a T-pose, facing +z
SKELETON: tuple[tuple[str, str, tuple[float, float, float]], ...] = (
    ("Hips", "", (0, 0, 0)),
    ("Spine", "Hips", (0, 10, 0)),
    ("Spine1", "Spine", (0, 12, 0)),
    ("Spine2", "Spine1", (0, 12, 0)),
    ("Neck", "Spine2", (0, 14, 0)),
    ("Head", "Neck", (0, 9, 0)),
    *(
        (name.format(side), parent.format(side), (sign * x, y, z))
        for side, sign in (("Left", 1), ("Right", -1))
        for name, parent, (x, y, z) in (
            ("{}Shoulder", "Spine2", (4, 10, 0)),
            ("{}Arm", "{}Shoulder", (13, 0, 0)),
            ("{}ForeArm", "{}Arm", (28, 0, 0)),
            ("{}Hand", "{}ForeArm", (25, 0, 0)),
            ("{}UpLeg", "Hips", (9, -4, 0)),
            ("{}Leg", "{}UpLeg", (0, -42, 0)),
            ("{}Foot", "{}Leg", (0, -41, 0)),
            ("{}Toe", "{}Foot", (0, -6, 13)),
        )
    ),
)
NAMES = tuple(name for name, *_ in SKELETON)
CHANNELS = "CHANNELS 3 Zrotation Xrotation Yrotation"
PLACED = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
FRAMES = 10

Offsets = Mapping[str, tuple[float, float, float]]


def human_bvh(
    offsets: Offsets | None = None, rename: Callable[[str], str] = str, places: str = "none"
) -> str:
    """The get-up's file.

    offsets: in place of a joint's own; rename: of every joint; places: position channels of the
    inner joints, `none`, `zero`, or `bones` (the offsets, while the OFFSET lines are zero).
    """
    bones = {name: offset for name, _, offset in SKELETON} | dict(offsets or {})
    written = {name: (0.0, 0.0, 0.0) for name in bones} if places == "bones" else bones
    lines = ["HIERARCHY", *_joint("Hips", "ROOT", written, rename, places), "MOTION"]
    lines += [f"Frames: {FRAMES}", "Frame Time: 0.0333333"]
    inner = {"none": [], "zero": [0.0] * 3}
    for row in _rows():
        values = list(row[:6])
        for name, turn in zip(_order()[1:], row[6:].reshape(-1, 3), strict=True):
            values += [*inner.get(places, bones[name]), *turn]
        lines.append(" ".join(f"{value:.6f}" for value in values))
    return "\n".join(lines) + "\n"


def _joint(
    name: str, key: str, offsets: Offsets, rename: Callable[[str], str], places: str, depth: int = 0
) -> list[str]:
    """The lines of a joint and of all below it."""
    tab = "\t" * depth
    channels = PLACED if key == "ROOT" or places != "none" else CHANNELS
    numbers = " ".join(f"{value:.6f}" for value in offsets[name])
    lines = [f"{tab}{key} {rename(name)}", f"{tab}{{", f"{tab}\tOFFSET {numbers}"]
    lines.append(f"{tab}\t{channels}")
    below = [child for child, parent, _ in SKELETON if parent == name]
    for child in below:
        lines += _joint(child, "JOINT", offsets, rename, places, depth + 1)
    if not below:
        lines += [f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\tOFFSET 0 5 0", f"{tab}\t}}"]
    return [*lines, f"{tab}}}"]


def _order(name: str = "Hips") -> list[str]:
    """The joints in the order of the file."""
    below = [child for child, parent, _ in SKELETON if parent == name]
    return [name, *(joint for child in below for joint in _order(child))]


def _rows() -> np.ndarray:
    """Channel values [F, 6 + 3 J] of a body that rises from its back with bent knees."""
    share = np.linspace(0, 1, FRAMES)
    rows = np.zeros((FRAMES, 3 + 3 * len(SKELETON)))
    rows[:, 1], rows[:, 4] = 12 + 83 * share, -90 * (1 - share)
    bend = 60 * np.sin(np.pi * share)
    for name, channel, sign, least in (
        *(("LeftUpLeg", 1, -1, 0), ("LeftLeg", 1, 2, 0), ("LeftForeArm", 2, -1, 0)),
        *(("RightUpLeg", 1, -1, 0), ("RightLeg", 1, 2, 0), ("RightForeArm", 2, 1, 0)),
        *(("LeftArm", 0, -1, -40), ("RightArm", 0, 1, 40)),
    ):
        rows[:, 3 + 3 * _order().index(name) + channel] = sign * bend + least
    return rows


BASE = human_bvh()
HEADER, _, MOTION = BASE.partition("MOTION\n")
TIMING = f"Frames: {FRAMES}\nFrame Time: 0.0333333\n"
ROWS = MOTION.removeprefix(TIMING)


def along_x(recording: Recording) -> Recording:
    """The same motion of a skeleton whose zero pose says nothing: every bone lies along +X."""
    count = len(recording.joint_names)
    axes = np.tile(np.eye(3), (count, 1, 1))  # the new axes in the old ones
    for joint, parent in enumerate(recording.parents):
        below = [recording.offsets[i] for i in range(count) if recording.parents[i] == joint]
        bone = next((offset for offset in below if offset.any()), None)
        along = axes[parent] if bone is None else shortest_turn(np.array([1.0, 0, 0]), bone)
        axes[joint] = along
    above = np.stack([np.eye(3), *(axes[parent] for parent in recording.parents[1:])])
    old = Rotation.from_quat(recording.rotations.reshape(-1, 4), scalar_first=True).as_matrix()
    turns = np.swapaxes(above, 1, 2) @ old.reshape(-1, count, 3, 3) @ axes
    quaternions = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    offsets = np.einsum("jba,jb->ja", above, recording.offsets)
    translations = np.tile(offsets, (recording.num_frames, 1, 1))
    translations[:, 0] = recording.translations[:, 0]
    return dataclasses.replace(
        recording,
        offsets=offsets,
        translations=translations,
        rotations=quaternions.reshape(-1, count, 4),
        ends={joint: axes[joint].T @ end for joint, end in recording.ends.items()},
    )


def with_rows(header, change):
    """The file with another header and every row of values changed."""
    return header + "MOTION\n" + TIMING + "".join(f"{change(row)}\n" for row in ROWS.splitlines())


def write(tmp_path, content, name="take.bvh"):
    file = tmp_path / name
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return file


def body_of(file):
    """{link: its translations and rotations [F, 7]}, and the rate."""
    recording, links = identify(read_motion(file))
    both = np.concatenate([recording.translations, recording.rotations], axis=-1)
    return {link: both[:, joint] for link, joint in links.items()}, recording.fps


def imported(tmp_path, character, content, *more):
    """Exit code of the command, the clip or None, and what it warned of."""
    file, report = write(tmp_path, content), tmp_path / "report.json"
    code = main(["import", str(file), "--out", str(tmp_path / "out"), "--json", str(report), *more])
    (entry,) = json.loads(report.read_text())
    kept = tmp_path / "out" / "take.npz"
    return code, read_npz(kept, character)[0] if kept.is_file() else None, entry
