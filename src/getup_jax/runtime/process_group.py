"""Which process of a run this one is, as its options or its launcher say; needs no JAX."""

from __future__ import annotations

import dataclasses
import os

DEFAULT_WAIT_S = 300.0
# environment variables with the number of tasks that a launcher has started beside this one
_LAUNCHERS = "SLURM_STEP_NUM_TASKS", "OMPI_COMM_WORLD_SIZE"


class ProcessError(ValueError):
    """The processes of a run do not come or stay together; the text says what to do."""


@dataclasses.dataclass(frozen=True)
class Group:
    """Which process of how many this one is; None: JAX detects it."""

    coordinator: str | None = None  # HOST:PORT of the first process
    processes: int | None = None
    process: int | None = None  # from 0
    detect: bool = False  # SLURM, MPI, Kubernetes or TPU say the rest
    wait_s: float = DEFAULT_WAIT_S  # for all to come

    def __post_init__(self) -> None:
        given = {
            "--coordinator": self.coordinator,
            "--processes": self.processes,
            "--process": self.process,
        }
        missing = [name for name, value in given.items() if value is None]
        if missing and len(missing) < len(given):
            raise ProcessError(f"{', '.join(missing)}: missing; give all of {', '.join(given)}")
        if not self.wait_s > 0:
            raise ProcessError(f"--wait: expected seconds above 0, got {self.wait_s:g}")
        if self.coordinator is not None and self.processes is not None and self.process is not None:
            address_of(self.coordinator)
            if self.processes < 1:
                raise ProcessError(f"--processes: expected at least 1, got {self.processes}")
            if not 0 <= self.process < self.processes:
                last = self.processes - 1
                raise ProcessError(f"--process: expected 0 to {last}, got {self.process}")

    @property
    def alone(self) -> bool:
        """Whether this is the run's only process."""
        if self.coordinator is not None:
            return self.processes == 1
        started = [os.environ.get(name, "") for name in _LAUNCHERS]
        return not self.detect and not any(n.isdigit() and int(n) > 1 for n in started)


def address_of(coordinator: str) -> tuple[str, int]:
    """Host and port; raises ProcessError."""
    host, _, port = coordinator.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) < 65536:
        expected = "HOST:PORT of the first process, such as 10.0.0.1:4711"
        raise ProcessError(f"--coordinator: expected {expected}, got {coordinator}")
    return host.strip("[]"), int(port)
