"""A recorded motion before retargeting: any skeleton, any format, Z up and in metres."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from getup_jax.motion.clips import MotionError

_MOST_FRAMES = 1_000_000  # nine hours at 30 Hz


@dataclasses.dataclass(frozen=True, eq=False)
class Recording:
    """Joint rotations over time on the recording's own skeleton.

    Joints come parents first; joint 0 is the root. The zero pose (all rotations identity)
    stands along +Z where the format has a human-like one.
    """

    name: str
    fps: float
    joint_names: tuple[str, ...]  # [N]
    parents: tuple[int, ...]  # [N] index of the parent, -1 at the root
    offsets: np.ndarray  # [N, 3] m, place in the parent's frame at rest
    translations: np.ndarray  # [F, N, 3] m, place in the parent's frame; root: world
    rotations: np.ndarray  # [F, N, 4] local, wxyz
    ends: dict[int, np.ndarray] = dataclasses.field(default_factory=dict)  # joint -> End Site (m)
    source: str = ""  # the file
    warnings: tuple[str, ...] = ()

    @property
    def num_frames(self) -> int:
        """F, the number of frames."""
        return len(self.rotations)

    def joint(self, name: str) -> int:
        """Index of a joint."""
        return self.joint_names.index(name)

    def warn(self, *texts: str) -> Recording:
        """The same motion with further warnings."""
        return dataclasses.replace(self, warnings=self.warnings + texts)


def forward(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """World positions [F, N, 3] (m) and rotation matrices [F, N, 3, 3] of all joints."""
    local = Rotation.from_quat(recording.rotations.reshape(-1, 4), scalar_first=True).as_matrix()
    return _chain(
        recording, recording.translations, local.reshape(*recording.rotations.shape[:2], 3, 3)
    )


def rest_positions(recording: Recording) -> np.ndarray:
    """Joint positions [N, 3] (m) of the zero pose, relative to the root."""
    offsets = recording.offsets.copy()
    offsets[0] = 0.0
    identity = np.broadcast_to(np.eye(3), (1, len(offsets), 3, 3))
    return _chain(recording, offsets[None], identity)[0][0]


def _chain(
    recording: Recording, translations: np.ndarray, local: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Walk the tree once, vectorised over the frames."""
    position, rotation = np.empty(translations.shape), np.empty(local.shape)
    for joint, parent in enumerate(recording.parents):
        if parent < 0:
            position[:, joint], rotation[:, joint] = translations[:, joint], local[:, joint]
            continue
        turned = rotation[:, parent] @ translations[:, joint, :, None]
        position[:, joint] = position[:, parent] + turned[..., 0]
        rotation[:, joint] = rotation[:, parent] @ local[:, joint]
    return position, rotation


def turned(recording: Recording, turn: Rotation) -> Recording:
    """The same motion in other world axes: every vector and rotation is carried along."""
    rotations = Rotation.from_quat(recording.rotations.reshape(-1, 4), scalar_first=True)
    quaternions = (turn * rotations * turn.inv()).as_quat(scalar_first=True)
    matrix = turn.as_matrix()
    return dataclasses.replace(
        recording,
        offsets=recording.offsets @ matrix.T,
        translations=recording.translations @ matrix.T,
        rotations=quaternions.reshape(recording.rotations.shape),
        ends={joint: matrix @ end for joint, end in recording.ends.items()},
    )


def scaled(recording: Recording, metres: float) -> Recording:
    """The same motion with every length times `metres`, the size of the file's unit."""
    return dataclasses.replace(
        recording,
        offsets=recording.offsets * metres,
        translations=recording.translations * metres,
        ends={joint: end * metres for joint, end in recording.ends.items()},
    )


def cut(recording: Recording, start: int, stop: int) -> Recording:
    """Frames start to stop, the last one excluded."""
    return dataclasses.replace(
        recording,
        translations=recording.translations[start:stop],
        rotations=recording.rotations[start:stop],
    )


def without_first(recording: Recording) -> Recording:
    """Frame 0 replaced by frame 1, so that the other frames keep their numbers."""
    index = np.maximum(np.arange(recording.num_frames), 1)
    return dataclasses.replace(
        recording,
        translations=recording.translations[index],
        rotations=recording.rotations[index],
    )


def resampled(recording: Recording, fps: float) -> Recording:
    """The same motion at another rate: slerp of the rotations, linear in the positions."""
    if recording.num_frames < 2 or abs(recording.fps - fps) < 1e-3 * fps:
        return dataclasses.replace(recording, fps=fps) if recording.num_frames else recording
    old = np.arange(recording.num_frames) / recording.fps
    return at_times(recording, old, even_times(recording.name, float(old[-1]), fps), fps)


def even_times(name: str, seconds: float, fps: float) -> np.ndarray:
    """Times (s) of the frames of a recording at a rate; MotionError where there are too many."""
    if not 0.0 <= seconds * fps < _MOST_FRAMES:
        raise MotionError(
            f"{name}: expected less than {_MOST_FRAMES} frames at {fps:g} Hz, got "
            f"{seconds:g} s; correct the rate or the durations in the file"
        )
    return np.arange(int(seconds * fps + 1e-6) + 1) / fps


def at_times(recording: Recording, old: np.ndarray, new: np.ndarray, fps: float) -> Recording:
    """Frames known at increasing times `old` [F] (s), read at times `new` (s)."""
    count = len(recording.joint_names)
    rotations = np.empty((len(new), count, 4))
    for joint in range(count):
        known = Rotation.from_quat(recording.rotations[:, joint], scalar_first=True)
        rotations[:, joint] = Slerp(old, known)(new).as_quat(scalar_first=True)
    flat = recording.translations.reshape(len(old), -1)
    columns = [np.interp(new, old, column) for column in flat.T]
    translations = np.stack(columns, axis=1).reshape(len(new), count, 3)
    return dataclasses.replace(recording, fps=fps, translations=translations, rotations=rotations)


def check_finite(recording: Recording) -> Recording:
    """The recording itself, or MotionError that names the first frame and joint with NaN."""
    values = np.concatenate([recording.translations, recording.rotations], axis=-1)
    bad = np.argwhere(~np.isfinite(values).all(axis=-1))
    if len(bad):
        frame, joint = bad[0]
        raise MotionError(
            f"{recording.source}: frame {frame}, joint {recording.joint_names[joint]}: "
            "expected finite numbers, got NaN or infinity; mend or cut that frame"
        )
    return recording
