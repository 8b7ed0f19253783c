"""Running a command in many processes that are one run."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable

from getup_jax.runtime import processes
from getup_jax.runtime.process_group import Group


def together(group: Group, command: Callable[[], int]) -> int:
    """Join the others, run the command and leave with them; returns its exit code.

    An error ends this process at once, and so the others, which would wait for it.
    """
    processes.join(group)
    try:
        code = command()
        processes.leave()
        return code
    except ValueError as error:
        if not type(error).__module__.startswith("getup_jax."):
            traceback.print_exc()
            processes.end(1)
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        processes.end(2)
    except BaseException:
        traceback.print_exc()
        processes.end(1)
