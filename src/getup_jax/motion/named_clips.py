"""Clips by name: the authored loops of composite motion, or any motion file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from getup_jax.config import ConfigError
from getup_jax.core.resources import asset_path
from getup_jax.motion.authoring.keyframe_clip import clip_from_keyframes
from getup_jax.motion.authoring.keyframe_file import read_keyframes
from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.io.readers import ReadOptions, is_clip
from getup_jax.motion.retarget.cache import Job, read_npz, retarget_files
from getup_jax.motion.retarget.retarget import RetargetSettings
from getup_jax.physics.character import CharacterSpec


def named_clips(names: Sequence[str], character: CharacterSpec, key: str) -> list[Clip]:
    """The clips of the names; ConfigError names the setting `key` where one is not there."""
    return [_named(name, character, key) for name in names]


def authored_names() -> list[str]:
    """The authored clips that are shipped."""
    return sorted(path.stem for path in asset_path("motions", "composite").glob("*.yaml"))


def _named(name: str, character: CharacterSpec, key: str) -> Clip:
    authored = asset_path("motions", "composite", f"{name}.yaml")
    path = Path(name).expanduser()
    try:
        if authored.is_file():
            return clip_from_keyframes(read_keyframes(authored, character), character)
        if path.is_file() and is_clip(path):
            return read_npz(path, character)[0]
        if path.is_file():
            job = Job(path, character, ReadOptions(allow_short=True), RetargetSettings())
            (result,) = retarget_files([job], 1)
            if isinstance(result, MotionError):
                raise result
            return result[0]
    except MotionError as error:
        raise ConfigError(f"{key}: {error}") from None
    raise ConfigError(
        f"{key}: no clip {name!r}; expected a motion file or one of {', '.join(authored_names())}"
    )
