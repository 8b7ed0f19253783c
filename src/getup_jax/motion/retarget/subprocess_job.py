"""Retargeting in a process of its own, which ends as soon as nobody waits for its result."""

from __future__ import annotations

import contextlib
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator

from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.io.guard import one_line
from getup_jax.motion.retarget.job import Job, Result
from getup_jax.motion.retarget.retarget import RetargetReport

_LONGEST = 200  # characters of what a process that failed said last


class AbandonedError(RuntimeError):
    """Nobody waits for the work any more."""


class Stop:
    """Ends work in other threads that nobody waits for, and the processes that it started."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._processes: set[subprocess.Popen[bytes]] = set()
        self._is_set = False

    def set(self) -> None:
        """End it, from any thread."""
        with self._lock:
            self._is_set = True
            for process in self._processes:
                process.kill()

    def check(self) -> None:
        """Raise AbandonedError once the work is to end; long loops ask now and then."""
        if self._is_set:
            raise AbandonedError

    @contextlib.contextmanager
    def watching(self, process: subprocess.Popen[bytes]) -> Iterator[None]:
        """Kill the process as soon as the work is to end, also if that was before."""
        with self._lock:
            self._processes.add(process)
            if self._is_set:
                process.kill()
        try:
            yield
        except BaseException:  # Ctrl-C, too: nobody would wait for it
            process.kill()
            raise
        finally:
            with self._lock:
                self._processes.discard(process)


def run_apart(
    job: Job, stop: Stop | None = None, memory: int | None = None
) -> tuple[Clip, RetargetReport]:
    """What `run_here` gives for the job, from a process of its own.

    A plain command is safe where JAX runs already and in scripts without a main guard, which
    neither fork nor spawn of multiprocessing are.

    Args:
        job: what to retarget.
        stop: ends the process; then AbandonedError is raised.
        memory: that the process may use (bytes); None: as much as there is.

    Raises MotionError where the file cannot be used.
    """
    stop = stop or Stop()
    # -P: no module comes from the current folder, which is where people keep their motions
    command = [sys.executable, "-P", "-m", "getup_jax.motion.retarget.worker"]
    command += [] if memory is None else [str(memory)]
    with one_line(job.path.name):
        code, output, said = _communicate(command, pickle.dumps(job), stop)
        if code:
            raise MotionError(f"{job.path.name}: {_end_of(code, said)}")
        result: Result = pickle.loads(output)
    if isinstance(result, MotionError):
        raise result
    return result


def _communicate(command: list[str], text: bytes, stop: Stop) -> tuple[int, bytes, bytes]:
    """Exit code and output of a command that gets the text; AbandonedError once it is stopped."""
    stop.check()
    pipe = subprocess.PIPE
    with (
        subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe) as process,
        stop.watching(process),
    ):
        output, said = process.communicate(text)
    stop.check()
    return process.returncode, output, said


def _end_of(code: int, said: bytes) -> str:
    """How a process ended that gave no result."""
    if code < 0:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        return f"retargeting was ended by {name}, perhaps for want of memory; cut it into parts"
    lines = said.decode(errors="replace").split("\n")
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f"retargeting ended with exit code {code}: {last[:_LONGEST] or 'without a word'}"
