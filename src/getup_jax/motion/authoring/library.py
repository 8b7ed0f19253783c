"""The authored library: reference get-ups from keyframes, and styles drawn as curves alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from getup_jax.config import PhysicsConfig
from getup_jax.core.resources import asset_path
from getup_jax.motion.authoring.keyframe_clip import clip_from_keyframes
from getup_jax.motion.authoring.keyframe_file import read_keyframes
from getup_jax.motion.authoring.other_body import carried_over, sized, takes_angles
from getup_jax.motion.clips import Clip, GetUp, MotionError
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.events import link_positions
from getup_jax.motion.getup.getups import clip_features, evenly
from getup_jax.motion.io.curve_file import check_start, read_curve_file
from getup_jax.physics.body_digest import body_digest
from getup_jax.physics.character import CharacterSpec, load_character

_FIT_SAMPLES = 256  # of every curve
_loaded: dict[tuple[str, ...], tuple[GetUp, ...]] = {}  # by the body


def load_authored(
    character: CharacterSpec, done: Callable[[Path], None] = lambda path: None
) -> list[GetUp]:
    """Every shipped get-up: the reference motions in order of name, then the drawn styles.

    A reference motion is called as its file; a drawn style NAME of 2.5 s is NAME@2.5. What a
    process has loaded for a body of these shapes and joints it keeps; the arrays are read-only.
    The keyframes' angles are those of the default body: on one with other hinges its motions are
    retargeted, and on one of another size the drawn heights are scaled. `done` is called after each
    file that is retargeted.
    """
    body = body_digest(character.model)
    key = tuple(body[part] for part in ("lengths", "masses", "shapes", "joints"))
    if key not in _loaded:
        _loaded[key] = tuple(_load(character, done))
    return list(_loaded[key])


def carried_files(character: CharacterSpec) -> list[Path]:
    """The shipped motions that are retargeted to this character; none where angles fit."""
    return [] if takes_angles(character, load_character(PhysicsConfig())) else _files()


def _files() -> list[Path]:
    return sorted(asset_path("motions").glob("*.yaml"))


def _load(character: CharacterSpec, done: Callable[[Path], None]) -> list[GetUp]:
    files = _files()
    written_for = load_character(PhysicsConfig())
    reads = character if takes_angles(character, written_for) else written_for
    motions = [read_keyframes(path, reads) for path in files]
    clips = [clip_from_keyframes(motion, reads) for motion in motions]
    if reads is not character:
        clips = [
            _told(carried_over(clip, reads, character), file, done)
            for clip, file in zip(clips, files, strict=True)
        ]
    references = [
        GetUp(clip.name, clip.duration, points, clip, motion.strategy, error)
        for motion, clip in zip(motions, clips, strict=True)
        for points, error in [_fit(clip, character)]
    ]
    names = tuple(clip.name for clip in clips)
    drawn = sorted(asset_path("curves").glob("*.yaml"))
    styles = [getup for path in drawn for getup in read_drawn(path, names)]
    found = [*references, *(sized(style, written_for, character) for style in styles)]
    for getup in found:
        getup.points.setflags(write=False)
        if getup.clip is not None:
            getup.clip.qpos.setflags(write=False)
    return found


def _told(clip: Clip, file: Path, done: Callable[[Path], None]) -> Clip:
    done(file)
    return clip


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


def _fit(clip: Clip, character: CharacterSpec) -> tuple[np.ndarray, np.ndarray]:
    """Control points [9, 3] of the clip's curves, and their error [3]."""
    values = clip_features(link_positions(clip, character), character)
    return curves.fit(evenly(values, _FIT_SAMPLES))
