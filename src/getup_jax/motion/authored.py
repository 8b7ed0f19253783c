"""The authored library: reference get-ups from keyframes, and styles drawn as curves alone."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import mujoco
import numpy as np
import yaml

from getup_jax.motion import curves
from getup_jax.motion.clips import Clip, GetUp, MotionError
from getup_jax.motion.features import NAMES, FeatureLinks, features
from getup_jax.motion.keyframe_clip import clip_from_keyframes
from getup_jax.motion.keyframe_file import read_keyframes
from getup_jax.paths import asset_path
from getup_jax.physics.character import CharacterSpec

_FIT_SAMPLES = 256  # of every curve, so that all are fitted at once
_CURVE_KEYS = ("name", "strategy", "start", "durations", *NAMES)


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

    The file holds nine control points of each feature (angles in degrees) and names the
    reference motion whose first pose it starts from. Raises MotionError.
    """
    path = Path(path)
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    if not isinstance(content, Mapping) or set(content) != set(_CURVE_KEYS):
        found = sorted(content) if isinstance(content, Mapping) else content
        raise MotionError(f"{path.name}: expected the keys {', '.join(_CURVE_KEYS)}, got {found}")
    if content["name"] != path.stem:
        raise MotionError(f"{path.name}: name: expected {path.stem!r}, got {content['name']!r}")
    if content["start"] not in references:
        raise MotionError(
            f"{path.name}: start: expected one of {', '.join(references)}, got {content['start']!r}"
        )
    points = np.stack([_nine_points(content, name, path) for name in NAMES], axis=1)
    points[:, 1:] = np.radians(points[:, 1:])
    return [
        GetUp(f"{path.stem}@{duration:g}", float(duration), points, None, content["strategy"])
        for duration in content["durations"]
    ]


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


def _nine_points(content: Mapping[str, Any], name: str, path: Path) -> np.ndarray:
    values = content[name]
    numeric = isinstance(values, list) and all(isinstance(v, int | float) for v in values)
    if not numeric or len(values) != curves.NUM_POINTS:
        raise MotionError(
            f"{path.name}: {name}: expected {curves.NUM_POINTS} numbers, got {values!r}"
        )
    return np.array(values, np.float64)


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
