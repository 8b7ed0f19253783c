"""The authored library: reference get-ups from keyframes, and styles drawn as curves alone."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path

import jax
import mujoco
import numpy as np

from getup_jax.core.resources import asset_path
from getup_jax.motion.authoring.keyframe_clip import clip_from_keyframes
from getup_jax.motion.authoring.keyframe_file import read_keyframes
from getup_jax.motion.clips import Clip, GetUp, MotionError
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.curves import NAMES, FeatureLinks, features
from getup_jax.motion.io.curve_file import check_start, read_curve_file
from getup_jax.physics.character import CharacterSpec

_FIT_SAMPLES = 256  # of every curve, so that all are fitted at once


def load_authored(character: CharacterSpec) -> list[GetUp]:
    """Every shipped get-up: the reference motions in order of name, then the drawn styles.

    A reference motion is called as its file; a drawn style NAME of 2.5 s is NAME@2.5.
    """
    files = sorted(asset_path("motions").glob("*.yaml"))
    motions = [read_keyframes(path, character) for path in files]
    clips = [clip_from_keyframes(motion, character) for motion in motions]
    fitted = _fit(clip_features(clips, character))
    references = [
        GetUp(clip.name, clip.duration, points, clip, motion.strategy, error)
        for motion, clip, (points, error) in zip(motions, clips, fitted, strict=True)
    ]
    names = tuple(clip.name for clip in clips)
    drawn = sorted(asset_path("curves").glob("*.yaml"))
    return [*references, *(getup for path in drawn for getup in read_drawn(path, names))]


def read_drawn(path: str | Path, references: Sequence[str]) -> list[GetUp]:
    """The get-ups of one curve file, one a duration, without a clip.

    The file names the reference motion whose first pose it starts from, and is called as its
    style. Raises MotionError.
    """
    path = Path(path)
    curve = read_curve_file(path)
    if curve.name != path.stem:
        raise MotionError(f"{path.name}: name: expected {path.stem!r}, got {curve.name!r}")
    check_start(curve, references)
    return curve.getups()


def clip_features(clips: Sequence[Clip], character: CharacterSpec) -> list[np.ndarray]:
    """The three features of every frame over flat ground, [F, 3] a clip.

    All clips go through one call, since every new length would compile again.
    """
    data = mujoco.MjData(character.model)
    poses = np.concatenate([clip.qpos for clip in clips])
    positions = np.empty((len(poses), len(character.link_names), 3), np.float32)
    for frame, qpos in enumerate(poses):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(character.model, data)
        positions[frame] = data.xpos[1:]
    values = jax.jit(functools.partial(features, FeatureLinks.of(character)))(positions, 0.0)
    return np.split(np.asarray(values), np.cumsum([len(clip.qpos) for clip in clips])[:-1])


def _fit(values: Sequence[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Control points [9, 3] and error [3] of several curves [F, 3], fitted in one call."""
    samples = np.linspace(0.0, 1.0, _FIT_SAMPLES)
    columns = [
        np.interp(samples, np.linspace(0.0, 1.0, len(curve)), column)
        for curve in values
        for column in curve.T
    ]
    points, error = curves.fit(np.stack(columns, axis=1))
    split = range(len(NAMES), len(columns), len(NAMES))
    return list(zip(np.split(points, split, axis=1), np.split(error, split), strict=True))
