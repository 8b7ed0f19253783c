"""Motions of the SMPL family as NumPy archives: AMASS, and what estimates bodies from video.

Arrays: rotation vectors of the joints in their parents, [F, 72] (SMPL), [F, 156] (SMPL-H) or
[F, 165] (SMPL-X) as `poses`, or in parts; the root's place `trans` [F, 3] (m); the rate. The zero
pose is a T along x with y up, facing z. No body model is needed: the retargeting takes the
rotations, so that a skeleton of an adult's proportions, that of the shipped character, stands in
for the subject's own. Where a file has `joints` [F, N, 3] (m), the bones are measured on them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.bvh import Y_UP
from getup_jax.motion.io.npz import names_in, read_arrays
from getup_jax.motion.io.recording import Recording, forward
from getup_jax.motion.retarget.up_axis import axis_of_motion

# name, parent, place in the parent (m) in the zero pose; hands and faces are left out
_SIDED = (
    *(("hip", "pelvis", (0.088, -0.04, 0.0)), ("knee", "{}_hip", (0.0, -0.4, 0.0))),
    *(("ankle", "{}_knee", (0.0, -0.4, 0.0)), ("foot", "{}_ankle", (0.0, -0.05, 0.13))),
    *(("collar", "spine3", (0.03, 0.16, 0.0)), ("shoulder", "{}_collar", (0.165, 0.0, 0.0))),
    *(("elbow", "{}_shoulder", (0.28, 0.0, 0.0)), ("wrist", "{}_elbow", (0.25, 0.0, 0.0))),
)
_MIDDLE = (
    *(("pelvis", "", (0.0, 0.0, 0.0)), ("spine1", "pelvis", (0.0, 0.09, 0.0))),
    *(("spine2", "spine1", (0.0, 0.11, 0.0)), ("spine3", "spine2", (0.0, 0.11, 0.0))),
    *(("neck", "spine3", (0.0, 0.22, 0.0)), ("head", "neck", (0.0, 0.08, 0.0))),
)
_BONES = {name: (parent, place) for name, parent, place in _MIDDLE} | {
    f"{side}_{name}": (parent.format(side), (sign * x, y, z))
    for side, sign in (("left", 1), ("right", -1))
    for name, parent, (x, y, z) in _SIDED
}
# in the order of all three models, of which these are the first joints
JOINTS = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2"),
    *("left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar"),
    *("right_collar", "head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow"),
    *("left_wrist", "right_wrist"),
)
_PARENTS = tuple(JOINTS.index(_BONES[n][0]) if _BONES[n][0] else -1 for n in JOINTS)
_POSES, _PLACES = ("poses", "pose", "fullpose"), ("trans", "transl")
_ROOTS, _BODIES = ("root_orient", "global_orient"), ("pose_body", "body_pose")
_RATES = ("mocap_framerate", "mocap_frame_rate", "framerate", "frame_rate", "fps")
_MEASURED = "joints"
_LARGEST = 1e4
# numbers of a frame: the joints that are read, and those of SMPL, SMPL-H and SMPL-X
_WIDTHS = (66, 72, 156, 165)


def is_smpl(path: Path) -> bool:
    """Whether an .npz file has rotations of a body of the SMPL family."""
    try:
        names = names_in(path)
    except MotionError:
        return False
    return bool({*_POSES, *_BODIES} & {*names})


def read_smpl(path: Path, up: str = "auto", fps: float | None = None) -> Recording:
    """The motion of a file, Z up.

    up: the file's vertical axis, y or z; auto: along which the body stands, else z, as in AMASS.
    fps: in place of the rate in the file. Raises MotionError.
    """
    arrays = _Arrays(path)
    turns = arrays.rotations()
    rate = fps or arrays.rate()
    place = arrays.first(_PLACES)
    bones = np.array([_BONES[name][1] for name in JOINTS])
    translations = np.tile(bones, (len(turns), 1, 1))
    translations[:, 0] = 0.0 if place is None else arrays.checked(place, (len(turns), 3))
    recording = Recording(
        name=path.stem,
        fps=rate,
        joint_names=JOINTS,
        parents=_PARENTS,
        offsets=bones,
        translations=translations,
        rotations=turns,
        source=str(path),
    )
    if place is None:
        recording = recording.warn("no trans: the body turns about one place")
    if _MEASURED in arrays.names:
        recording = _measured(recording, arrays.checked(_MEASURED, (len(turns), -1, 3)))
    return _z_up(recording, up)


class _Arrays:
    """What is in a file, checked when it is read."""

    def __init__(self, path: Path) -> None:
        self.path, self.names = path, names_in(path)

    def first(self, names: Sequence[str]) -> str | None:
        """The first of the names that is in the file."""
        return next((name for name in names if name in self.names), None)

    def checked(self, name: str, shape: tuple[int, ...]) -> np.ndarray:
        """The array in this shape, -1 for any number; MotionError where it has another one."""
        values = read_arrays(self.path, (name,))[name]
        fits = values.ndim == len(shape) and all(
            want in (-1, got) for want, got in zip(shape, values.shape, strict=True)
        )
        if not fits or values.dtype.kind not in "iuf":
            wanted = " x ".join("any" if n < 0 else str(n) for n in shape)
            raise MotionError(
                f"{self.path.name}: {name}: expected {wanted} numbers, got {values.dtype} of shape "
                f"{values.shape}"
            )
        bad = np.argwhere(~(np.abs(values) < _LARGEST))
        if len(bad):
            raise MotionError(
                f"{self.path.name}: {name}: frame {bad[0][0]}: expected finite numbers, got "
                f"{values[tuple(bad[0])]}; mend or cut that frame"
            )
        return values.astype(np.float64)

    def rotations(self) -> np.ndarray:
        """Of JOINTS [F, 22, 4] wxyz in their parents."""
        whole = self.first(_POSES)
        values = self._flat(whole) if whole is not None else self._in_parts()
        if len(values) < 1 or values.shape[1] not in _WIDTHS:
            raise self._no_vectors(whole or "poses", values.shape)
        vectors = values[:, : 3 * len(JOINTS)].reshape(-1, 3)
        turns = Rotation.from_rotvec(vectors).as_quat(scalar_first=True)
        return turns.reshape(len(values), len(JOINTS), 4)

    def _no_vectors(self, name: str, shape: tuple[int, ...]) -> MotionError:
        widths = ", ".join(map(str, _WIDTHS[:-1]))
        return MotionError(
            f"{self.path.name}: {name}: expected frames of {widths} or {_WIDTHS[-1]} numbers, "
            f"rotation vectors of the joints, got {shape}; cut other hands off: poses[:, "
            f":{_WIDTHS[0]}]; matrices and quaternions are converted with scipy's "
            "Rotation.from_matrix(m).as_rotvec() and from_quat"
        )

    def _flat(self, name: str) -> np.ndarray:
        """[F, 3 N], also of [F, N, 3]."""
        values = read_arrays(self.path, (name,))[name]
        if values.ndim == 3 and values.shape[2] == 3:
            return self.checked(name, (-1, -1, 3)).reshape(len(values), -1)
        if values.ndim != 2:
            raise self._no_vectors(name, values.shape)
        return self.checked(name, (-1, -1))

    def _in_parts(self) -> np.ndarray:
        """The root and the body in two arrays; a body of 23 joints ends in the hands."""
        root, body = self.first(_ROOTS), self.first(_BODIES)
        if root is None or body is None:
            raise MotionError(
                f"{self.path.name}: expected poses, or root_orient and pose_body, got "
                f"{', '.join(sorted(self.names))}"
            )
        parts = self._flat(root), self._flat(body)
        if len(parts[0]) != len(parts[1]) or parts[0].shape[1] != 3:
            raise MotionError(
                f"{self.path.name}: {root}, {body}: expected as many frames, and 3 numbers for the "
                f"root, got {parts[0].shape} and {parts[1].shape}"
            )
        return np.concatenate(parts, axis=1)

    def rate(self) -> float:
        """Frames a second."""
        name = self.first(_RATES)
        value = None if name is None else read_arrays(self.path, (name,))[name]
        if value is None or value.size != 1 or value.dtype.kind not in "iuf":
            got = "none" if value is None else f"{value.dtype} of shape {value.shape}"
            raise MotionError(
                f"{self.path.name}: expected a rate as {_RATES[0]}, got {got}; give it with "
                "--source-fps 30"
            )
        fps = float(value.ravel()[0])
        if not 1.0 <= fps <= _LARGEST:
            raise MotionError(
                f"{self.path.name}: {name}: expected frames a second, got {fps:g}; give it with "
                "--source-fps 30"
            )
        return fps


def _measured(recording: Recording, joints: np.ndarray) -> Recording:
    """The recording with the bones that its file's joints [F, N, 3] (m) have."""
    if joints.shape[1] < len(JOINTS):
        raise MotionError(
            f"{Path(recording.source).name}: joints: expected at least {len(JOINTS)}, in the order "
            f"of the model, got {joints.shape[1]}; leave them out of the file"
        )
    _, world = forward(recording)
    offsets, translations = recording.offsets.copy(), recording.translations.copy()
    for joint, parent in enumerate(_PARENTS[1:], start=1):
        way = joints[:, joint] - joints[:, parent]
        offsets[joint] = np.einsum("fji,fj->fi", world[:, parent], way).mean(axis=0)
        translations[:, joint] = offsets[joint]
    return dataclasses.replace(recording, offsets=offsets, translations=translations)


def _z_up(recording: Recording, up: str) -> Recording:
    """The zero pose along z, and the world z up."""
    axis = (axis_of_motion(recording) or "z") if up == "auto" else up
    if axis not in ("y", "z"):
        raise MotionError(
            f"{Path(recording.source).name}: the body stands along {axis}, expected y or z; turn "
            "it (videos have y down), or give --up y or --up z if that is wrong"
        )
    count = recording.rotations.shape[1]
    local = Rotation.from_quat(recording.rotations.reshape(-1, 4), scalar_first=True)
    turns = (Y_UP * local * Y_UP.inv()).as_quat(scalar_first=True).reshape(-1, count, 4)
    root = Rotation.from_quat(recording.rotations[:, 0], scalar_first=True)
    places = Y_UP.apply(recording.translations.reshape(-1, 3)).reshape(-1, count, 3)
    if axis == "z":  # the root's turn is from the model's axes to the world's
        turns[:, 0] = (root * Y_UP.inv()).as_quat(scalar_first=True)
        places[:, 0] = recording.translations[:, 0]
    return dataclasses.replace(
        recording,
        offsets=Y_UP.apply(recording.offsets),
        translations=places,
        rotations=turns,
    )
