"""The authored library: reference get-ups from keyframes, and styles drawn as curves alone."""

from __future__ import annotations

from pathlib import Path

import jax.numpy as jnp
import mujoco
import numpy as np

from getup_jax.motion import curves
from getup_jax.motion.clips import Clip, GetUp
from getup_jax.motion.features import FeatureLinks, features
from getup_jax.motion.keyframe_clip import clip_from_keyframes
from getup_jax.motion.keyframe_file import read_keyframes
from getup_jax.paths import asset_path
from getup_jax.physics.character import CharacterSpec


def load_authored(character: CharacterSpec) -> list[GetUp]:
    """Every shipped get-up: the reference motions in order of name, then the drawn styles."""
    return [_reference(path, character) for path in sorted(asset_path("motions").glob("*.yaml"))]


def clip_features(clip: Clip, character: CharacterSpec) -> np.ndarray:
    """The three features of every frame over flat ground, [F, 3]."""
    data = mujoco.MjData(character.model)
    positions = np.empty((len(clip.qpos), len(character.link_names), 3))
    for frame, qpos in enumerate(clip.qpos):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(character.model, data)
        positions[frame] = data.xpos[1:]
    return np.asarray(features(FeatureLinks.of(character), jnp.asarray(positions), 0.0))


def _reference(path: Path, character: CharacterSpec) -> GetUp:
    motion = read_keyframes(path, character)
    clip = clip_from_keyframes(motion, character)
    points, error = curves.fit(clip_features(clip, character))
    return GetUp(motion.name, clip.duration, points, clip, motion.strategy, error)
