"""Iterations on many devices, in a process of their own that has four virtual ones."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
# The sums of an iteration are the same numbers in another order: float32 has 24 bits, and Adam's
# step divides by the root of a mean, so that a few last bits become some more.
ROUNDING = 2e-5


@pytest.fixture(scope="module")
def found() -> dict:
    flags = os.environ.get("XLA_FLAGS", "") + " --xla_force_host_platform_device_count=4"
    paths = [str(HERE), str(HERE.parent / "envs"), *filter(None, sys.path)]
    environment = {**os.environ, "XLA_FLAGS": flags, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, str(HERE / "spread_samples.py")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("devices", [2, 4])
def test_the_same_samples_give_the_state_of_one_device(found, devices):
    samples = found["samples"]
    assert samples["moved"] > 1e-3
    assert samples[f"state {devices}"] < ROUNDING
    assert samples[f"metrics {devices}"] < ROUNDING


@pytest.mark.parametrize("task", ["getup", "composite"])
def test_tasks_on_many_devices(found, task):
    assert found[task] == {
        "finite": True,
        "same on all": True,  # networks, statistics, counters
        "parts differ": True,  # from the same start states: every device draws its own
        "programs": 1,  # two iterations, one compilation
        "physics": 0.0,
    }
