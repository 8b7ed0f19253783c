"""A simulated motion as a file: GLB, USD, BVH, NumPy's npz, CSV or a film."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from getup_jax.config import ConfigError
from getup_jax.editor.films import Progress, write_film
from getup_jax.editor.simulate import Motion
from getup_jax.editor.skeleton import recording
from getup_jax.editor.takes import WHOLE, Cut, take
from getup_jax.evaluation import film
from getup_jax.motion.getup.curves import NAMES
from getup_jax.motion.io.bvh_writer import write_bvh
from getup_jax.motion.io.curve_file import dump
from getup_jax.motion.io.glb_writer import glb_bytes, require_glb
from getup_jax.motion.io.takes import Take
from getup_jax.motion.io.usd_writer import require_usd, write_usd
from getup_jax.motion.retarget.retarget import RetargetReport
from getup_jax.motion.retarget.subprocess_job import Stop
from getup_jax.physics.character import CharacterSpec

FORMATS = ("glb", "usd", "bvh", "npz", "csv", "mp4")
_REQUIRED = (
    ("mp4", film.require, "video"),
    ("glb", require_glb, "glb"),
    ("usd", require_usd, "usd"),
)
_SOURCE = "getup-edit"


def export(
    motion: Motion,
    character: CharacterSpec,
    kind: str,
    cut: Cut = WHOLE,
    stop: Stop | None = None,
    progress: Progress = lambda share: None,
) -> bytes:
    """The content of a file of one of the FORMATS; a film ends early once stopped.

    CSV and npz are the whole motion at the control's rate: they hold what was simulated.
    """
    if kind == "csv":
        return to_csv(motion, character).encode()
    if kind == "npz":
        return to_npz(motion, character)
    if kind == "glb":
        fps, qpos = take(motion, cut)
        return glb_bytes(character, [Take(motion.curve.name, fps, qpos)])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"motion.{kind}"
        if kind == "bvh":
            write_bvh(recording(motion.curve.name, *take(motion, cut), character), path)
        elif kind == "usd":
            write_usd(path, character, [Take(motion.curve.name, *take(motion, cut))])
        else:
            write_film(motion, character, path, cut, stop or Stop(), progress)
        return path.read_bytes()


def missing_extras() -> dict[str, str]:
    """What to install for each format that cannot be written here."""
    found = {}
    for kind, require, extra in _REQUIRED:
        try:
            require()
        except ConfigError:
            found[kind] = f"pip install 'getup-jax[{extra}]'"
    return found


def to_npz(motion: Motion, character: CharacterSpec) -> bytes:
    """A clip that `getup-motion` and `motion.source` read, with what else is known of it."""
    frames = motion.frames
    report = RetargetReport(
        frames=len(frames.qpos),
        position_error_m=0.0,
        worst_error_m=0.0,
        clipped=0.0,
        penetration_m=0.0,
        jump_rad=float(np.abs(np.diff(frames.qpos[:, 7:], axis=0)).max()),
        jump_joint="",
        unknown_joints=(),
        warnings=("simulated, not retargeted from a recording",),
    )
    arrays: dict[str, Any] = {
        "qpos": frames.qpos,
        "fps": 1.0 / motion.control_dt,
        "name": motion.curve.name,
        "source": _SOURCE,
        "joints": np.array(character.joint_names),
        "report": json.dumps(dataclasses.asdict(report)),
        "links": np.array(character.link_names),
        "link_position": frames.links[..., :3],
        "link_quaternion": frames.links[..., 3:],
        "time": motion.time,
        "features": frames.features,
        "target": motion.target,
        "in_episode": frames.running,
        "curve": dump(motion.curve),
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def to_csv(motion: Motion, character: CharacterSpec) -> str:
    """A row a frame: time, the curves and what was achieved, root, hinges; SI units, Z up."""
    frames = motion.frames
    root = [f"root_{axis}_m" for axis in "xyz"] + [f"root_q{axis}" for axis in "wxyz"]
    header = ["time_s", "in_episode"]
    header += [f"{kind}_{name}" for kind in ("target", "achieved") for name in _units()]
    header += root + [f"{name}_rad" for name in character.joint_names]
    rows = np.concatenate([motion.target, frames.features, frames.qpos], axis=1)
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(header)
    for time, running, row in zip(motion.time, frames.running, rows, strict=True):
        writer.writerow([f"{time:.4f}", int(running), *(f"{value:.6f}" for value in row)])
    return buffer.getvalue()


def _units() -> list[str]:
    return [f"{name}_{unit}" for name, unit in zip(NAMES, ("m", "rad", "rad"), strict=True)]
