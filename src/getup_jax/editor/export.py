"""A simulated motion as a file: BVH, NumPy's npz, CSV or a film."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.editor.simulate import Motion
from getup_jax.evaluation import film
from getup_jax.motion.getup.curves import NAMES
from getup_jax.motion.io.bvh_writer import write_bvh
from getup_jax.motion.io.curve_file import dump
from getup_jax.motion.io.glb_writer import glb_bytes
from getup_jax.motion.io.recording import Recording
from getup_jax.motion.io.takes import Take
from getup_jax.motion.io.usd_writer import write_usd
from getup_jax.motion.retarget.retarget import RetargetReport
from getup_jax.motion.retarget.subprocess_job import Stop
from getup_jax.physics.character import CharacterSpec

FORMATS = ("bvh", "npz", "csv", "mp4")
_SOURCE = "getup-edit"


def export(motion: Motion, character: CharacterSpec, kind: str, stop: Stop | None = None) -> bytes:
    """The content of a file: one of the FORMATS, `glb` or `usd`; a film ends once stopped."""
    take = Take(motion.curve.name, 1.0 / motion.control_dt, motion.frames.qpos)
    if kind == "glb":
        return glb_bytes(character, [take])
    if kind == "csv":
        return to_csv(motion, character).encode()
    if kind == "npz":
        return to_npz(motion, character)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"motion.{kind}"
        if kind == "bvh":
            write_bvh(recording(motion, character), path)
        elif kind == "usd":
            write_usd(path, character, [take])
        else:
            _film(motion, character, path, stop or Stop())
        return path.read_bytes()


def recording(motion: Motion, character: CharacterSpec) -> Recording:
    """The motion on the character's own skeleton: a joint a link, Z up, metres."""
    model, links = character.model, motion.frames.links.astype(np.float64)
    parents = model.body_parentid[1:] - 1
    frames, count = links.shape[:2]
    world = Rotation.from_quat(links[..., 3:].reshape(-1, 4), scalar_first=True).as_matrix()
    world = world.reshape(frames, count, 3, 3)
    local = world.copy()
    for link, parent in enumerate(parents):
        if parent >= 0:
            local[:, link] = world[:, parent].transpose(0, 2, 1) @ world[:, link]
    rotations = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    offsets = model.body_pos[1:].copy()
    offsets[0] = 0.0
    translations = np.tile(offsets, (frames, 1, 1))
    translations[:, 0] = links[:, 0, :3]
    return Recording(
        name=motion.curve.name,
        fps=1.0 / motion.control_dt,
        joint_names=character.link_names,
        parents=tuple(int(parent) for parent in parents),
        offsets=offsets,
        translations=translations,
        rotations=rotations.reshape(frames, count, 4),
        ends=_ends(character),
        source=_SOURCE,
    )


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


def _ends(character: CharacterSpec) -> dict[int, np.ndarray]:
    """The tip of every last link: as far past the middle of its first shape as the joint is."""
    model = character.model
    inner = set(model.body_parentid[1:].tolist())
    return {
        body - 1: 2.0 * model.geom_pos[model.body_geomadr[body]]
        for body in range(1, model.nbody)
        if body not in inner
    }


def _film(motion: Motion, character: CharacterSpec, path: Path, stop: Stop) -> None:
    imageio = film.require()
    images = film.pictures(character.model, motion.frames.qpos)
    with warnings.catch_warnings():
        # starting ffmpeg is a fork and an exec in one, which is safe
        warnings.filterwarnings("ignore", message="os.fork", category=RuntimeWarning)
        fps = round(1.0 / motion.control_dt)
        with imageio.get_writer(path, fps=fps, macro_block_size=8) as writer:
            for image in images:
                stop.check()
                writer.append_data(film.caption(image, motion.curve.name))
