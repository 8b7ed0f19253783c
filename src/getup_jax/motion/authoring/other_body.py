"""The authored library on a body that is not the one it was written for."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import mujoco
import numpy as np

from getup_jax.motion.clips import Clip, GetUp
from getup_jax.motion.io.readers import ReadOptions
from getup_jax.motion.retarget.body import record
from getup_jax.motion.retarget.cache import kept
from getup_jax.motion.retarget.job import Job
from getup_jax.motion.retarget.retarget import RetargetReport, RetargetSettings, retarget
from getup_jax.physics.character import CharacterSpec

_SAME_SIZE = 1e-6


def takes_angles(character: CharacterSpec, written_for: CharacterSpec) -> bool:
    """Whether angles mean the same on both: the same hinges, about the same axes."""
    if character.joint_names != written_for.joint_names:
        return False
    one, other = character.model, written_for.model
    same_axes = np.allclose(one.jnt_axis[1:], other.jnt_axis[1:])
    return same_axes and np.allclose(one.body_quat[2:], other.body_quat[2:])


def carried_over(clip: Clip, written_for: CharacterSpec, character: CharacterSpec) -> Clip:
    """The clip on another body, retargeted as a recording would be, and kept as one."""

    def run(job: Job) -> tuple[Clip, RetargetReport]:
        return retarget(record(clip, written_for), character, job.settings)

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, f"{clip.name}.npy")  # kept under its content
        np.save(file, clip.qpos.astype(np.float32))
        settings = RetargetSettings(fps=clip.fps)  # its floor: where its soles stand
        found, _ = kept(Job(file, character, ReadOptions(), settings), run)
    return dataclasses.replace(found, name=clip.name, fps=clip.fps, source=clip.source)


def sized(getup: GetUp, written_for: CharacterSpec, character: CharacterSpec) -> GetUp:
    """A drawn style whose heights are those of another body's neck."""
    ratio = neck_height(character) / neck_height(written_for)
    if abs(ratio - 1.0) < _SAME_SIZE:
        return getup
    return dataclasses.replace(getup, points=getup.points * [ratio, 1.0, 1.0])


def neck_height(character: CharacterSpec) -> float:
    """Of the neutral pose (m)."""
    data = mujoco.MjData(character.model)
    data.qpos[:] = character.neutral_qpos
    mujoco.mj_kinematics(character.model, data)
    return float(data.xpos[character.link("neck") + 1][2])
