"""Starts the processes of a run, as a user would."""

from __future__ import annotations

import dataclasses
import os
import socket
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
PATHS = [HERE, HERE.parent.parent / "rl"]
SETTINGS = [
    "ppo.num_envs=16",
    "ppo.num_steps=8",
    "ppo.minibatch_size=32",
    "network.hidden_sizes=[16]",
]
STEPS = 16 * 8  # of an iteration


@dataclasses.dataclass(frozen=True)
class Ended:
    """What a process left behind."""

    code: int
    out: str
    err: str


class Process:
    """A running `getup-train` of probe_run.py."""

    def __init__(self, folder: Path, *more: str, devices: int = 1) -> None:
        flags = f"{os.environ['XLA_FLAGS']} --xla_force_host_platform_device_count={devices}"
        paths = os.pathsep.join([*map(str, PATHS), *filter(None, sys.path)])
        script = str(HERE / "probe_run.py")
        self.popen = subprocess.Popen(
            [sys.executable, "-u", script, "quick", "--run", str(folder), *SETTINGS, *more],
            env={**os.environ, "XLA_FLAGS": flags, "PYTHONPATH": paths},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def end(self, timeout_s: float = 300.0) -> Ended:
        out, err = self.popen.communicate(timeout=timeout_s)
        return Ended(self.popen.returncode, out, err)


class Launcher:
    """Starts processes, and kills those that a failed test leaves."""

    def __init__(self) -> None:
        self.started: list[Process] = []

    def one(self, folder: Path, *more: str, devices: int = 1) -> Process:
        self.started.append(Process(folder, *more, devices=devices))
        return self.started[-1]

    def two(self, folder: Path, *more: str) -> list[Process]:
        """Both processes of a run."""
        address = f"127.0.0.1:{free_port()}"
        options = ["--coordinator", address, "--processes", "2", "--process"]
        return [self.one(folder, *more, *options, str(index)) for index in range(2)]


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]
