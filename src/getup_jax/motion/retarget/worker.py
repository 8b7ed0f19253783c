"""`python -P -m getup_jax.motion.retarget.worker [BYTES]`: pickled Jobs in, their results out.

BYTES is the memory that it may use. It ends where the process that started it has ended.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import sys
import threading
import time

# The solver's matrices are small: threads of the linear algebra only cost time.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from getup_jax.motion.clips import MotionError  # noqa: E402
from getup_jax.motion.retarget.job import Job, Result, run_here  # noqa: E402

_LOOK_S = 0.5  # how often it looks for the process that started it


def main() -> None:
    """Serve the jobs on stdin, until it ends."""
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is for the one who started it
    if len(sys.argv) > 1:
        limit_memory(int(sys.argv[1]))
    output = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    sys.stdout = sys.stderr  # whatever prints must not break the answer
    while (job := _next()) is not None:
        try:
            result: Result = run_here(job)
        except MotionError as error:
            result = error
        pickle.dump(result, output)
        output.flush()


def _next() -> Job | None:
    try:
        return pickle.load(sys.stdin.buffer)
    except EOFError:
        return None


def end_with_parent() -> None:
    """End this process once the one that started it has ended, however that came."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def limit_memory(size: int) -> None:
    """Take at most so many bytes, where the system can see to it: what is more is a MemoryError."""
    try:
        import resource
    except ImportError:  # not on this system
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = size if hard == resource.RLIM_INFINITY else min(size, hard)
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_AS, (most, hard))


if __name__ == "__main__":
    main()
