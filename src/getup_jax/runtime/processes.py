"""The processes of one run, on one machine or many, joined by JAX's own distributed runtime.

Every process runs the same program on its own devices, and what reduces over simulations reduces
over all of them. The first process alone talks and writes; with one process, nothing here does
anything.
"""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import jax
import numpy as np
from jax.experimental import multihost_utils

from getup_jax.runtime.process_group import Group, ProcessError, address_of
from getup_jax.runtime.runtime_errors import translate_stderr

_GRACE_S = 3.0
_LOST = 3  # exit code of a process whose run has lost another one
# of what JAX says where another process has gone; its own texts differ by platform
_GONE = ("gloo", "nccl", "connection", "unavailable", "heartbeat", "deadline_exceeded", "socket")


def join(group: Group) -> None:
    """Wait until all processes of the run are there; before anything else is done with JAX.

    Raises ProcessError where they cannot be. If they do not come in time, the process ends with one
    line: JAX's runtime waits in C++, and would end it with a stack trace.
    """
    if group.alone:
        return
    _wake_without_preempting()
    jax.config.update("jax_cpu_collectives_implementation", "gloo")
    with contextlib.suppress(AttributeError):  # SIGTERM is for the loop, see signals.py
        jax.config.update("jax_enable_preemption_service", False)
    begin, given = time.monotonic(), group.coordinator is not None
    if group.coordinator is not None and group.process:
        _wait_for_coordinator(group.coordinator, group.wait_s)
    translate_stderr()
    timer = threading.Timer(group.wait_s - (time.monotonic() - begin), _give_up, [group])
    timer.daemon = True
    timer.start()
    try:
        jax.distributed.initialize(
            group.coordinator,
            group.processes,
            group.process,
            local_device_ids=None,
            cluster_detection_method="deactivate" if given else None,
            initialization_timeout=int(group.wait_s) + 60,
        )
    except (RuntimeError, ValueError) as error:
        raise _not_joined(group, error) from None
    finally:
        timer.cancel()


def _wake_without_preempting() -> None:
    """Every thread that this process begins from here on is one of Linux's batch scheduling policy.

    gloo's thread polls while another one holds a connection's lock. Where it wakes up on that one's
    core it takes the core, and polls until the scheduler's next tick: a reduction of 0.1 ms takes
    4 ms. A thread of the batch policy has its share of the time, but waits for it.
    """
    with contextlib.suppress(AttributeError, OSError):  # not Linux, or not allowed
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def count() -> int:
    """Processes of the run."""
    return jax.process_count()


def is_first() -> bool:
    """Whether this process is the one that talks and writes."""
    return jax.process_index() == 0


def leave() -> None:
    """End this process's part of a run that all have finished."""
    if count() > 1:
        jax.distributed.shutdown()


def end(code: int) -> NoReturn:
    """End this process now; at an exit JAX would wait for the others, which may wait for it.

    The first one gives them a moment, since they end with it: they may have the same to say.
    """
    if code and count() > 1 and is_first():
        time.sleep(_GRACE_S)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


@contextlib.contextmanager
def lost_is_an_error():
    """While this is open, another process that is lost raises ProcessError."""
    try:
        yield
    except (RuntimeError, ValueError, OSError) as error:
        ours = type(error).__module__.startswith("getup_jax.")
        # an error of ours may be what another one looked like, as where a checkpoint was written
        cause = error.__cause__ if ours else error
        if count() == 1 or not any(word in str(cause).lower() for word in _GONE):
            raise
        me = f"process {jax.process_index()} of {count()}"
        problem = " ".join(str(cause).split())[:160]
        hint = "start all of them again with --resume to go on from the last checkpoint"
        raise ProcessError(
            f"{me}: another process of this run is gone ({problem}); {hint}"
        ) from error


def gathered(values: Sequence[int]) -> np.ndarray:
    """The values of all processes, int64 [processes, values]."""
    if count() == 1:
        return np.asarray([values], np.int64)
    # in halves, since JAX has no 64 bits here
    halves = np.asarray([values], np.int64).view(np.uint32)
    return multihost_utils.process_allgather(halves, tiled=True).view(np.int64)


def from_first(tree: Any) -> Any:
    """The first process's arrays, in all of them; those of one process as they are."""
    return tree if count() == 1 else multihost_utils.broadcast_one_to_all(tree)


def first_alone(action: Callable[[], object]) -> None:
    """Do something in the first process; the others wait, and stop if it could not be done."""
    error: Exception | None = None
    if is_first():
        try:
            action()
        except Exception as problem:
            error = problem
    failed = gathered([error is not None])[0, 0]
    if error is not None:
        raise error
    if failed:
        me = jax.process_index()
        raise ProcessError(f"process {me}: stopped, since the first process could not go on")


def barrier(name: str) -> None:
    """Go on when all processes are here."""
    if count() > 1:
        multihost_utils.sync_global_devices(name)


def _wait_for_coordinator(coordinator: str, wait_s: float) -> None:
    """Return when somebody listens there."""
    deadline, problem = time.monotonic() + wait_s, "no answer"
    while (left := deadline - time.monotonic()) > 0:
        try:
            socket.create_connection(address_of(coordinator), timeout=min(left, 5.0)).close()
            return
        except OSError as error:
            problem = str(error.strerror or error)
        time.sleep(min(0.2, max(left, 0.0)))
    raise ProcessError(
        f"--coordinator {coordinator}: not reached within {wait_s:g} s ({problem}); start process "
        "0 there, and let its port through the firewall"
    )


def _give_up(group: Group) -> None:
    """End a process that waits in C++ for others that do not come."""
    size = "all" if group.processes is None else f"all {group.processes}"
    where = "" if group.coordinator is None else f" at {group.coordinator}"
    print(
        f"ProcessError: not {size} processes came together{where} within {group.wait_s:g} s; start "
        "every one with the same --coordinator and --processes, and a --process of its own",
        file=sys.stderr,
        flush=True,
    )
    os._exit(_LOST)


def _not_joined(group: Group, error: Exception) -> ProcessError:
    problem = " ".join(str(error).split())
    if "RPC server" in problem:
        hint = "is the port in use? choose another one"
        return ProcessError(f"--coordinator {group.coordinator}: cannot listen there; {hint}")
    if group.coordinator is None:
        hint = "give --coordinator, --processes and --process instead"
        return ProcessError(f"no cluster was detected ({problem}); {hint}")
    return ProcessError(f"--coordinator {group.coordinator}: {problem}")
