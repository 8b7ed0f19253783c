"""Whatever a reader did not foresee, as one line for its user."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from getup_jax.motion.clips import MotionError


@contextlib.contextmanager
def one_line(name: str) -> Iterator[None]:
    """Turn unexpected exceptions into a MotionError that names the file and no path.

    What the package itself says passes as it is. The cause stays in `__cause__`.
    """
    try:
        yield
    except Exception as error:
        if type(error).__module__.startswith("getup_jax."):
            raise
        raise MotionError(f"{name}: {_what_to_do(error)}") from error


def _what_to_do(error: Exception) -> str:
    if isinstance(error, MemoryError):
        return "needs more memory than there is; cut it into shorter files"
    if isinstance(error, RecursionError):
        return "expected a motion, got lists within lists too deep to read; export it again"
    if isinstance(error, OSError):
        return f"cannot be read: {error.strerror or type(error).__name__}"
    return (
        f"expected a motion, got content that makes no sense ({type(error).__name__}); export it "
        "again, or report it if other programs read it"
    )
