"""Motions for tools of animation: what they are, their links' poses, and which file holds them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.motion.clips import continuous_signs
from getup_jax.physics.character import CharacterSpec


@dataclasses.dataclass(frozen=True, eq=False)
class Take:
    """One motion of the character."""

    name: str
    fps: float
    qpos: np.ndarray  # [F, 7 + J]


def local_poses(character: CharacterSpec, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places [F, L, 3] (m) and rotations [F, L, 4] (x y z w) of links in their parents."""
    model, links = character.model, len(character.link_names)
    data = mujoco.MjData(model)
    position, world = np.empty((len(qpos), links, 3)), np.empty((len(qpos), links, 4))
    for frame, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        position[frame], world[frame] = data.xpos[1:], data.xquat[1:]
    local = world.copy()
    place = np.tile(model.body_pos[1:], (len(qpos), 1, 1))
    place[:, 0] = position[:, 0]
    for link, parent in enumerate(model.body_parentid[1:] - 1):
        if parent >= 0:
            turn = Rotation.from_quat(world[:, parent], scalar_first=True).inv()
            own = turn * Rotation.from_quat(world[:, link], scalar_first=True)
            local[:, link] = own.as_quat(scalar_first=True)
        # rotations are interpolated the short way
        local[1:, link] *= continuous_signs(local[:, link])[1:]
    return place, np.roll(local, -1, axis=-1)


def write_takes(path: Path, character: CharacterSpec, takes: Sequence[Take]) -> None:
    """Write a GLB or a USD file, by the suffix of its name.

    Raises ConfigError where the extra for it is missing.
    """
    # the writers need what is above
    from getup_jax.motion.io.glb_writer import write_glb
    from getup_jax.motion.io.usd_writer import SUFFIXES, write_usd

    write = write_usd if path.suffix.lower() in SUFFIXES else write_glb
    write(path, character, takes)
