"""Retargeted clips kept on disk, and files retargeted side by side.

A clip is kept under a hash of all that it depends on: the file's content, the options, the
character's shape and this package's motion code. So a stale clip is never read.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import pickle
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from getup_jax.motion import readers
from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.names import listed
from getup_jax.motion.retarget import RetargetReport, RetargetSettings, retarget
from getup_jax.motion.text import read_bytes
from getup_jax.paths import cache_dir
from getup_jax.physics.character import CharacterSpec

# Code whose change makes other clips out of the same files.
_CODE = (
    *("asf_amc", "axes", "body", "bones", "branches", "bvh", "bvh_header", "bvh_rows"),
    *("calibrate", "composite_json", "deepmimic", "identify", "jacobian", "names", "prefixes"),
    *("readers", "retarget", "skeleton", "solver", "targets", "text", "upright"),
)
_SHAPE = (
    *("body_parentid", "body_pos", "body_quat", "geom_bodyid", "geom_type", "geom_size"),
    *("geom_pos", "geom_quat", "jnt_type", "jnt_bodyid", "jnt_axis", "jnt_pos", "jnt_range"),
)


@dataclasses.dataclass(frozen=True, eq=False)
class Job:
    """What a worker needs to retarget one file."""

    path: Path
    character: CharacterSpec
    read: readers.ReadOptions
    settings: RetargetSettings


Result = tuple[Clip, RetargetReport] | MotionError


def retarget_files(
    jobs: Sequence[Job],
    workers: int,
    done: Callable[[Path], None] = lambda path: None,
    apart: bool = False,
) -> list[Result]:
    """One result a job, in order; a file that fails gives its error and stops no other.

    apart: in a process of its own also where there is but one, so that this one stays quick.
    """
    run = run_here if len(jobs) == 1 and not apart else _run_worker

    def one(job: Job) -> Result:
        try:
            result: Result = load(job) or store(job, run(job))
        except MotionError as error:
            result = error
        done(job.path)
        return result

    with ThreadPoolExecutor(max(1, workers)) as pool:
        return list(pool.map(one, jobs))


def key(job: Job) -> str:
    """The hash that a job's clip is kept under."""
    digest = hashlib.sha256()
    for file in (job.path, *_companions(job.path)):
        digest.update(read_bytes(file))
    digest.update(job.path.name.encode())
    digest.update(repr((job.read, job.settings, job.character.link_names)).encode())
    digest.update(repr(job.character.joint_names).encode())
    for name in _SHAPE:
        digest.update(np.ascontiguousarray(getattr(job.character.model, name)).tobytes())
    digest.update(job.character.neutral_qpos.tobytes())
    for name in _CODE:
        digest.update((Path(__file__).parent / f"{name}.py").read_bytes())
    return digest.hexdigest()[:24]


def load(job: Job) -> tuple[Clip, RetargetReport] | None:
    """The kept clip, or None."""
    file = _file(job)
    if not file.is_file():
        return None
    try:
        return read_npz(file, job.character)
    except (MotionError, KeyError, ValueError, OSError):
        file.unlink(missing_ok=True)  # half written
        return None


def store(job: Job, result: tuple[Clip, RetargetReport]) -> tuple[Clip, RetargetReport]:
    """Keep a clip; the same result comes back."""
    file = _file(job)
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_suffix(".part.npz")
    write_npz(part, *result, job.character)
    part.replace(file)
    return result


def write_npz(file: Path, clip: Clip, report: RetargetReport, character: CharacterSpec) -> None:
    """A clip with its joint names and its report."""
    np.savez_compressed(
        file,
        qpos=clip.qpos.astype(np.float32),
        fps=clip.fps,
        name=clip.name,
        source=clip.source,
        joints=np.array(character.joint_names),
        report=json.dumps(dataclasses.asdict(report)),
    )


def read_npz(file: Path, character: CharacterSpec) -> tuple[Clip, RetargetReport]:
    """A clip that `write_npz` made for the same character."""
    try:
        with np.load(file) as data:
            values = {name: data[name] for name in data.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise MotionError(f"{file}: not a clip: {error}") from None
    needed = {"qpos", "fps", "name", "source", "joints", "report"}
    if not needed <= values.keys():
        raise MotionError(f"{file}: expected {sorted(needed)}, got {sorted(values)}; import again")
    joints = tuple(str(name) for name in values["joints"])
    if joints != character.joint_names:
        raise MotionError(
            f"{file}: made for another character: {_difference(joints, character.joint_names)}; "
            "import its source again for this character"
        )
    report = json.loads(str(values["report"]))
    for name in ("unknown_joints", "warnings"):
        report[name] = tuple(report[name])
    clip = Clip(
        str(values["name"]),
        float(values["fps"]),
        values["qpos"].astype(np.float64),
        str(values["source"]),
    )
    return clip, RetargetReport(**report)


def _difference(theirs: Sequence[str], ours: Sequence[str]) -> str:
    """In what the joints of two characters differ."""
    lacks = [name for name in ours if name not in theirs]
    more = [name for name in theirs if name not in ours]
    texts = [f"lacks joint {listed(lacks)}"] if lacks else []
    texts += [f"has joint {listed(more)}, which this one has not"] if more else []
    if texts:
        return ", ".join(texts)
    pairs = zip(theirs, ours, strict=False)
    one, other = next((pair for pair in pairs if pair[0] != pair[1]), (theirs[-1], ours[-1]))
    return f"its joints have another order, {one} where this one has {other}"


def run_here(job: Job) -> tuple[Clip, RetargetReport]:
    """Read and retarget in this process."""
    return retarget(readers.read_motion(job.path, job.read), job.character, job.settings)


def _run_worker(job: Job) -> tuple[Clip, RetargetReport]:
    """Retarget in a process of its own, so that files run side by side.

    A plain command is safe where JAX runs already and in scripts without a main guard, which
    neither fork nor spawn of multiprocessing are.
    """
    command = [sys.executable, "-m", "getup_jax.motion.worker"]
    process = subprocess.run(command, input=pickle.dumps(job), capture_output=True, check=False)
    if process.returncode:
        text = process.stderr.decode(errors="replace").strip()
        raise RuntimeError(f"{job.path}: retargeting stopped with an error:\n{text}")
    result = pickle.loads(process.stdout)
    if isinstance(result, MotionError):
        raise result
    return result


def _file(job: Job) -> Path:
    return cache_dir() / "clips" / f"{job.path.stem}-{key(job)}.npz"


def _companions(path: Path) -> Iterator[Path]:
    """Other files that a motion file needs: the .asf skeletons beside an .amc."""
    if path.suffix.lower() == ".amc":
        yield from sorted(f for f in path.parent.iterdir() if f.suffix.lower() == ".asf")
