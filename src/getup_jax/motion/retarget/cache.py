"""Retargeted clips kept on disk, and files retargeted side by side.

A clip is kept under a hash of all that it depends on: the file's content, the options, the
character's shape and this package's motion code. So a stale clip is never read.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import threading
import uuid
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from getup_jax.core.resources import cache_dir
from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.io.npz import read_arrays
from getup_jax.motion.io.text import read_bytes
from getup_jax.motion.retarget.job import Job, Result, run_here
from getup_jax.motion.retarget.joint_names import listed
from getup_jax.motion.retarget.retarget import RetargetReport
from getup_jax.motion.retarget.subprocess_job import Stop, Worker
from getup_jax.physics.character import CharacterSpec

# Code whose change makes other clips out of the same files.
_CODE = (
    *("io/asf_amc", "io/bvh", "io/bvh_header", "io/bvh_rows", "io/composite_json"),
    *("io/deepmimic", "io/readers", "io/recording", "io/smpl", "io/text"),
    *("retarget/axes", "retarget/body", "retarget/bone_lengths", "retarget/calibrate"),
    *("retarget/identify", "retarget/ik_branches", "retarget/jacobian", "retarget/joint_names"),
    *("retarget/name_prefixes", "retarget/retarget", "retarget/solver", "retarget/targets"),
    "retarget/up_axis",
)
_MOTION = Path(__file__).parent.parent
_MOST = 1e4  # m, rad or Hz
_FEW = 4  # joints that an error names
_SHAPE = (
    *("body_parentid", "body_pos", "body_quat", "geom_bodyid", "geom_type", "geom_size"),
    *("geom_pos", "geom_quat", "jnt_type", "jnt_bodyid", "jnt_axis", "jnt_pos", "jnt_range"),
)

Run = Callable[[Job], tuple[Clip, RetargetReport]]
Done = Callable[[Path, Result], None]


def retarget_files(
    jobs: Sequence[Job], workers: int, done: Done = lambda path, result: None
) -> list[Result]:
    """One result a job, in order; a file that fails gives its error and stops no other.

    Several are retargeted side by side, in processes that each take one file after the other.
    `done` is called as each is finished, from the thread that it was finished in.
    """
    if len(jobs) == 1:
        return [_finished(jobs[0], run_here, done)]
    own, stop = threading.local(), Stop()  # own.worker: of each thread

    def run(job: Job) -> tuple[Clip, RetargetReport]:
        if not hasattr(own, "worker"):
            own.worker = running.enter_context(Worker(stop))
        return own.worker.run(job)

    with contextlib.ExitStack() as running, ThreadPoolExecutor(max(1, workers)) as pool:
        try:
            return list(pool.map(lambda job: _finished(job, run, done), jobs))
        except BaseException:  # Ctrl-C, too: nobody waits for what is still being retargeted
            stop.set()
            raise


def _finished(job: Job, run: Run, done: Done) -> Result:
    try:
        result: Result = kept(job, run)
    except MotionError as error:
        result = error
    done(job.path, result)
    return result


def kept(job: Job, run: Run) -> tuple[Clip, RetargetReport]:
    """The kept clip, or the one that `run` makes now, which is then kept."""
    return load(job) or store(job, run(job))


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
        digest.update((_MOTION / f"{name}.py").read_bytes())
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
    """Keep a clip, where the disk can; the same result comes back."""
    file = _file(job)
    part = file.with_name(f"{uuid.uuid4().hex}.part.npz")  # others may make the same one
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        write_npz(part, *result, job.character)
        part.replace(file)
    with contextlib.suppress(OSError):
        part.unlink(missing_ok=True)
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
    """A clip that `write_npz` made for the same character; MotionError says why it is none."""
    values = read_arrays(file, ("qpos", "fps", "name", "source", "joints", "report"))
    joints = tuple(str(name) for name in values["joints"].ravel())
    if joints != character.joint_names:
        raise MotionError(
            f"{file}: made for another character: {_difference(joints, character.joint_names)}; "
            "import its source again for this character"
        )
    qpos, fps = values["qpos"], values["fps"]
    _check_motion(file, qpos, fps, character)
    clip = Clip(str(values["name"]), float(fps), qpos.astype(np.float64), str(values["source"]))
    return clip, _report(file, str(values["report"]))


def _check_motion(file: Path, qpos: np.ndarray, fps: np.ndarray, character: CharacterSpec) -> None:
    """Raise MotionError unless the arrays are a motion of the character."""
    columns = 7 + character.num_joints
    if qpos.dtype.kind != "f" or qpos.ndim != 2 or qpos.shape[1] != columns or len(qpos) < 2:
        raise MotionError(
            f"{file}: qpos: expected at least 2 rows of {columns} numbers, got {qpos.shape} of "
            f"{qpos.dtype}; import again"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        norm = np.linalg.norm(qpos[:, 3:7], axis=1)
    good = (np.abs(qpos) < _MOST).all(axis=1) & (np.abs(norm - 1.0) < 0.1)
    if not good.all():
        raise MotionError(
            f"{file}: qpos: row {np.argmin(good)}: expected finite numbers and a unit quaternion; "
            "import again"
        )
    if fps.shape or fps.dtype.kind not in "fiu" or not 0.0 < float(fps) < _MOST:
        raise MotionError(f"{file}: fps: expected a rate above 0; import again")


def _difference(theirs: Sequence[str], ours: Sequence[str]) -> str:
    """In what the joints of two characters differ."""
    lacks = [name for name in ours if name not in theirs]
    more = [name for name in theirs if name not in ours]
    texts = [f"lacks joint {listed(lacks, _FEW)}"] if lacks else []
    texts += [f"has joint {listed(more, _FEW)}, which this one has not"] if more else []
    if texts:
        return ", ".join(texts)
    pairs = zip(theirs, ours, strict=False)
    one, other = next((pair for pair in pairs if pair[0] != pair[1]), (theirs[-1], ours[-1]))
    return f"its joints have another order, {one} where this one has {other}"


def _report(file: Path, text: str) -> RetargetReport:
    try:
        report = json.loads(text)
        for name in ("unknown_joints", "warnings"):
            report[name] = tuple(report[name])
        return RetargetReport(**report)
    except (ValueError, TypeError, LookupError, RecursionError):
        raise MotionError(f"{file}: report: expected that of an import; import again") from None


def _file(job: Job) -> Path:
    return cache_dir() / "clips" / f"{job.path.stem[:40]}-{key(job)}.npz"


def _companions(path: Path) -> Iterator[Path]:
    """Other files that a motion file needs: the .asf skeletons beside an .amc."""
    if path.suffix.lower() == ".amc" and path.is_file():
        yield from sorted(f for f in path.parent.iterdir() if f.suffix.lower() == ".asf")
