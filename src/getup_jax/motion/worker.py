"""`python -P -m getup_jax.motion.worker`: a pickled Job in, its pickled result out."""

from __future__ import annotations

import os
import pickle
import sys

# The solver's matrices are small: threads of the linear algebra only cost time.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from getup_jax.motion.cache import Job, Result, run_here  # noqa: E402
from getup_jax.motion.clips import MotionError  # noqa: E402


def main() -> None:
    """Serve the one job on stdin."""
    output = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    sys.stdout = sys.stderr  # whatever prints must not break the answer
    job: Job = pickle.load(sys.stdin.buffer)
    try:
        result: Result = run_here(job)
    except MotionError as error:
        result = error
    pickle.dump(result, output)
    output.close()


if __name__ == "__main__":
    main()
