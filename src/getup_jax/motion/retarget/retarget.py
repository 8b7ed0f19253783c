"""A recording on a character: the one function that turns mocap into a Clip.

Unit, rate and rest pose are sorted out first, then `targets` says where each link should be
and `solver` finds the joint angles; `branches` takes the arms' angles that are nearer to rest.
What is left of the floor's penetration is lifted away.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.io.recording import (
    Recording,
    check_finite,
    cut,
    forward,
    resampled,
    scaled,
    without_first,
)
from getup_jax.motion.retarget.body import Body, body_of, hull_heights
from getup_jax.motion.retarget.bone_lengths import guess_unit, require_body
from getup_jax.motion.retarget.identify import identify
from getup_jax.motion.retarget.ik_branches import BranchSettings, nearer_branches
from getup_jax.motion.retarget.joint_names import unknown_joints
from getup_jax.motion.retarget.solver import SolverSettings, solve_clip
from getup_jax.motion.retarget.targets import Targets, make_targets
from getup_jax.physics.character import CharacterSpec

_MEAN_ERROR_M, _LINK_ERROR_M = 0.05, 0.1  # of all links and of one: more is not this motion
_MOST_FRAMES = 300_000  # of a clip
_SHOWN = 6  # links in a warning


@dataclasses.dataclass(frozen=True)
class RetargetSettings:
    """How recordings become clips."""

    fps: float = 30.0  # rate of the clip
    metres: float | None = None  # size of the recording's unit; None: from the leg length
    floor: float | None = None  # m, height of the recording's floor; None: where it stands
    names: Mapping[str, str | None] | None = None  # {joint: link}, overrides the built-in names
    solver: SolverSettings = dataclasses.field(default_factory=SolverSettings)
    branches: BranchSettings = dataclasses.field(default_factory=BranchSettings)
    penetration_m: float = 0.005  # what may stay below the floor
    lift_s: float = 0.2  # time over which the lift out of the floor is smoothed


@dataclasses.dataclass(frozen=True)
class RetargetReport:
    """How well a clip follows its recording."""

    frames: int
    position_error_m: float  # mean distance of link centres to the scaled recording
    worst_error_m: float
    clipped: float  # share of hinge angles at a limit
    penetration_m: float  # deepest point below the floor
    jump_rad: float  # largest change of a hinge from frame to frame
    jump_joint: str
    unknown_joints: tuple[str, ...]
    warnings: tuple[str, ...]


def retarget(
    recording: Recording,
    character: CharacterSpec,
    settings: RetargetSettings = RetargetSettings(),
) -> tuple[Clip, RetargetReport]:
    """The recording's motion on the character, and how well it fits.

    Raises MotionError where joints that are needed have no known name or no bone.
    """
    recording, links = identify(recording, settings.names)
    recording = require_body(check_finite(recording), links)
    recording = prepare(recording, links, settings)
    body = body_of(character)
    targets = make_targets(recording, links, body, settings.floor)
    qpos = solve_clip(body, targets, settings.solver)
    qpos = nearer_branches(qpos, character, settings.fps, settings.branches)
    qpos[:, 2] += lift(_hull_minimum(qpos, body), settings)
    clip = Clip(recording.name, settings.fps, qpos, recording.source)
    unknown = tuple(unknown_joints(recording.joint_names, links))
    return clip, _report(clip, body, targets, unknown, recording.warnings)


def prepare(
    recording: Recording, links: Mapping[str, int], settings: RetargetSettings
) -> Recording:
    """In metres, without a leading T-pose, at the clip's rate."""
    if not recording.num_frames:
        raise MotionError(f"{recording.name}: expected at least one frame, got none")
    frames = recording.num_frames / recording.fps * settings.fps
    if frames > _MOST_FRAMES:
        raise MotionError(
            f"{recording.name}: {recording.num_frames:,} frames at {recording.fps:g} a second are "
            f"{frames:,.0f} at {settings.fps:g}, expected at most {_MOST_FRAMES:,}; cut the file, "
            "or give its rate with --source-fps"
        )
    recording = scaled(recording, settings.metres or guess_unit(recording, links))
    if starts_in_t_pose(recording, links):
        recording = without_first(recording).warn(
            "first row is a T-pose: dropped (the second stands in, so frame numbers stay)"
        )
    return resampled(recording, settings.fps)


def starts_in_t_pose(recording: Recording, links: Mapping[str, int]) -> bool:
    """True where frame 0 has its arms straight aside and frame 1 is another pose."""
    if recording.num_frames < 3:
        return False
    head = cut(recording, 0, 2)
    position, rotation = forward(head)
    side = position[0, links["thigh_l"]] - position[0, links["thigh_r"]]
    for hand, sign in (("l", 1.0), ("r", -1.0)):
        for start, end in (("arm", "forearm"), ("forearm", "hand")):
            last = links.get(f"{end}_{hand}", links[f"forearm_{hand}"])
            way = sign * (position[0, last] - position[0, links[f"{start}_{hand}"]])
            if way @ side < 0.94 * np.linalg.norm(way) * np.linalg.norm(side):
                return False
    trace = np.einsum("nij,nij->n", rotation[0], rotation[1])
    turned = np.arccos(np.clip(0.5 * (trace - 1), -1, 1))
    return bool(turned.mean() > 0.2)


def lift(lowest: np.ndarray, settings: RetargetSettings) -> np.ndarray:
    """How far to raise each frame [F] (m): smooth in time, and enough everywhere."""
    depth = np.maximum(-settings.penetration_m - lowest, 0.0)
    reach = max(1, round(settings.lift_s * settings.fps))
    envelope = maximum_filter1d(depth, 2 * reach + 1)
    # cut at the window's reach, the smoothed envelope never falls below the depth itself
    return gaussian_filter1d(envelope, reach / 2, truncate=2.0)


def _poses(qpos: np.ndarray, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Link centres [F, L, 3] and rotations [F, L, 3, 3] of poses."""
    model, data = body.character.model, mujoco.MjData(body.character.model)
    count = len(body.character.link_names)
    position, rotation = np.empty((len(qpos), count, 3)), np.empty((len(qpos), count, 3, 3))
    for frame, pose in enumerate(qpos):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        position[frame], rotation[frame] = data.xpos[1:], data.xmat[1:].reshape(-1, 3, 3)
    return position, rotation


def _hull_minimum(qpos: np.ndarray, body: Body) -> np.ndarray:
    """Lowest point of the character in every frame [F] (m)."""
    return hull_heights(*_poses(qpos, body), body).min(axis=1)


def _report(
    clip: Clip,
    body: Body,
    targets: Targets,
    unknown: tuple[str, ...],
    warnings: tuple[str, ...],
) -> RetargetReport:
    position, rotation = _poses(clip.qpos, body)
    known = sorted(targets.names)
    error = np.linalg.norm((position - targets.position)[:, known], axis=-1)
    warnings += _large_errors(error.mean(axis=0), [targets.names[link] for link in known])
    hinges, character = clip.qpos[:, 7:], body.character
    at_limit = (hinges <= character.joint_lower + 1e-6) | (hinges >= character.joint_upper - 1e-6)
    jumps = np.abs(np.diff(hinges, axis=0)).max(axis=0) if len(hinges) > 1 else np.zeros(1)
    depth = -hull_heights(position, rotation, body).min()
    return RetargetReport(
        frames=len(clip.qpos),
        position_error_m=float(error.mean()),
        worst_error_m=float(error.max()),
        clipped=float(at_limit.mean()),
        penetration_m=max(float(depth), 0.0),
        jump_rad=float(jumps.max()),
        jump_joint=character.joint_names[int(jumps.argmax())],
        unknown_joints=unknown,
        warnings=warnings,
    )


def _large_errors(mean: np.ndarray, names: Sequence[str]) -> tuple[str, ...]:
    """A warning where the clip is not the recording's motion; `mean` [L] (m) is of each link."""
    if mean.mean() <= _MEAN_ERROR_M and mean.max() <= _LINK_ERROR_M:
        return ()
    worst = [k for k in np.argsort(-mean) if mean[k] > _MEAN_ERROR_M][:_SHOWN]
    links = ", ".join(f"{names[k]} {100 * mean[k]:.0f} cm" for k in worst)
    return (
        f"mean error {100 * mean.mean():.1f} cm, at most {100 * _MEAN_ERROR_M:.0f} cm are usual: "
        f"the clip is another motion than the file's at {links}; check the lengths of the file's "
        "bones, --names and --up",
    )
