"""Curves out of a motion file that a page sends."""

from __future__ import annotations

import io
import re
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from getup_jax.editor.starts import reference_curve
from getup_jax.motion.clips import Clip, GetUp, MotionError
from getup_jax.motion.getup.getups import find_getups
from getup_jax.motion.io.curve_file import DURATION_S, CurveFile
from getup_jax.motion.io.guard import one_line
from getup_jax.motion.io.readers import SUFFIXES, ReadOptions, is_clip
from getup_jax.motion.retarget.cache import kept, read_npz
from getup_jax.motion.retarget.job import Job
from getup_jax.motion.retarget.retarget import RetargetSettings
from getup_jax.motion.retarget.subprocess_job import Stop, run_apart
from getup_jax.physics.character import CharacterSpec

_MAX_UNPACKED_BYTES = 256_000_000  # of an npz file, which may be packed very tightly
_WORKER_BYTES = 4_000_000_000  # of memory, for a file of at most 32 MB
_MOST_FRAMES = 100_000  # almost an hour
_STEM_BYTES = 120
_MOST = 20  # get-ups taken from one file
_DIGITS = 6  # of the start pose


def curves_of(
    name: str, content: bytes, character: CharacterSpec, stop: Stop | None = None
) -> list[CurveFile]:
    """The curve of every get-up in a motion file; see `getups_of`."""
    return [curve_of(getup) for getup in getups_of(name, content, character, stop)]


def getups_of(
    name: str, content: bytes, character: CharacterSpec, stop: Stop | None = None
) -> list[GetUp]:
    """Every get-up in a motion file that a curve file can hold.

    Raises MotionError with the file's name and no other path, and AbandonedError once it is
    stopped.
    """
    stop = stop or Stop()
    suffix = Path(name).suffix.lower()
    known = (*SUFFIXES, ".npz")
    if suffix not in known or suffix == ".amc":
        takes = ", ".join(kind for kind in known if kind != ".amc")
        raise MotionError(f"{name}: expected a file that ends in {takes}")
    if suffix == ".npz":
        _check_unpacked(name, content)
    clip = _clip(name, content, character, stop)
    if len(clip.qpos) > _MOST_FRAMES:
        raise MotionError(
            f"{name}: expected at most {_MOST_FRAMES} frames, got {len(clip.qpos)}; cut it into "
            "parts"
        )
    stop.check()
    with one_line(name):
        _, getups = find_getups(clip, character)
    if not getups:
        raise MotionError(
            f"{name}: no get-up in {clip.duration:.0f} s; expected a body that lies on the floor "
            "and then stands"
        )
    good = [getup for getup in getups if DURATION_S[0] <= getup.duration <= DURATION_S[1]]
    return good[:_MOST]


def _check_unpacked(name: str, content: bytes) -> None:
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            size = sum(part.file_size for part in file.infolist())
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError):
        raise MotionError(f"{name}: not a clip: expected an .npz file of getup-motion") from None
    if size > _MAX_UNPACKED_BYTES:
        raise MotionError(
            f"{name}: expected at most {_MAX_UNPACKED_BYTES // 1_000_000} MB unpacked, got "
            f"{size // 1_000_000} MB"
        )


def _clip(name: str, content: bytes, character: CharacterSpec, stop: Stop) -> Clip:
    """The file's motion; what is said of it speaks of the name that its owner knows."""
    own = Path(name)
    with one_line(name), tempfile.TemporaryDirectory() as folder:
        # letters may take four bytes each, and a name of a file 255 in all
        stem = _plain(own.stem).encode()[:_STEM_BYTES].decode(errors="ignore")
        path = Path(folder) / f"{stem}{own.suffix.lower()}"
        path.write_bytes(content)
        try:
            return _retargeted(path, character, stop)
        except MotionError as error:
            text = str(error).replace(str(path), name).replace(path.name, name)
            raise MotionError(text.replace(f"{folder}/", "")) from error


def _retargeted(path: Path, character: CharacterSpec, stop: Stop) -> Clip:
    if is_clip(path):
        return read_npz(path, character)[0]
    job = Job(path, character, ReadOptions(allow_short=True), RetargetSettings())
    return kept(job, lambda job: run_apart(job, stop, _WORKER_BYTES))[0]


def curve_of(getup: GetUp) -> CurveFile:
    """The curve of a get-up, with the start pose of its own."""
    assert getup.clip is not None
    curve = reference_curve(getup)
    name = _plain(getup.name)
    return CurveFile(
        name=name,
        strategy=curve.strategy,
        start=name,
        durations=curve.durations,
        values=curve.values,
        pose=np.round(getup.clip.qpos[0].astype(np.float64), _DIGITS),
    )


def _plain(name: str) -> str:
    """The name with nothing in it that a curve file's name may not have."""
    return re.sub(r"[^\w.@:~ -]", "_", name)[:80] or "motion"
