"""Retargeting in a process of its own, which ends as soon as nobody waits for its result."""

from __future__ import annotations

import contextlib
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from typing import IO

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


class Worker:
    """A process that retargets one file after the other; one that has ended is started anew.

    A plain command is safe where JAX runs already and in scripts without a main guard, which
    neither fork nor spawn of multiprocessing are. Most of what a file of some seconds takes is the
    start of the process, so that many files should share one.

    Args:
        stop: ends the process; then AbandonedError is raised.
        memory: that the process may use (bytes); None: as much as there is.
    """

    def __init__(self, stop: Stop | None = None, memory: int | None = None) -> None:
        self._stop = stop or Stop()
        # -P: no module comes from the current folder, which is where people keep their motions
        self._command = [sys.executable, "-P", "-m", "getup_jax.motion.retarget.worker"]
        self._command += [] if memory is None else [str(memory)]
        self._process: subprocess.Popen[bytes] | None = None
        # its stderr: a pipe that nobody reads would fill
        self._said = tempfile.TemporaryFile()  # noqa: SIM115

    def run(self, job: Job) -> tuple[Clip, RetargetReport]:
        """What `run_here` gives for the job; MotionError where the file cannot be used."""
        self._stop.check()
        with one_line(job.path.name):
            process = self._process or self._start()
            with self._stop.watching(process):
                result = self._answer(process, job)
        if isinstance(result, MotionError):
            raise result
        return result

    def close(self) -> None:
        """End the process, which has nothing to do between two jobs."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            _release(process)
        self._said.close()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _start(self) -> subprocess.Popen[bytes]:
        self._said.seek(0)
        self._said.truncate()
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(self._command, stdin=pipe, stdout=pipe, stderr=self._said)
        return self._process

    def _answer(self, process: subprocess.Popen[bytes], job: Job) -> Result:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            # beside: a job is more than a pipe holds, and whoever answers without having read it
            # would wait for its reader
            threading.Thread(target=_send, args=(job, process.stdin), daemon=True).start()
            return pickle.load(process.stdout)
        except Exception as error:
            self._process = None  # whatever it would say next belongs to this job
            if not isinstance(error, EOFError):
                process.kill()
            _release(process)
            self._stop.check()
            if isinstance(error, EOFError) and process.returncode:
                self._said.seek(0)
                text = _end_of(process.returncode, self._said.read())
                raise MotionError(f"{job.path.name}: {text}") from None
            raise


def _send(job: Job, pipe: IO[bytes]) -> None:
    with contextlib.suppress(OSError, ValueError):  # it has ended: there is no answer, either
        pickle.dump(job, pipe)
        pipe.flush()


def _release(process: subprocess.Popen[bytes]) -> None:
    """Wait for a process that ends, and close its pipes."""
    with contextlib.suppress(OSError):
        process.__exit__(None, None, None)


def run_apart(
    job: Job, stop: Stop | None = None, memory: int | None = None
) -> tuple[Clip, RetargetReport]:
    """What `run_here` gives for the job, from a process of its own; see `Worker`."""
    with Worker(stop, memory) as worker:
        return worker.run(job)


def _end_of(code: int, said: bytes) -> str:
    """How a process ended that gave no result."""
    if code < 0:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        return f"retargeting was ended by {name}, perhaps for want of memory; cut it into parts"
    lines = said.decode(errors="replace").split("\n")
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f"retargeting ended with exit code {code}: {last[:_LONGEST] or 'without a word'}"
