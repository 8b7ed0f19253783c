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


def spread(*parts: str) -> dict:
    """What spread_samples.py says of these parts."""
    flags = os.environ.get("XLA_FLAGS", "") + " --xla_force_host_platform_device_count=4"
    paths = [str(HERE), str(HERE.parent / "envs"), *filter(None, sys.path)]
    environment = {**os.environ, "XLA_FLAGS": flags, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, str(HERE / "spread_samples.py"), *parts]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def found() -> dict:
    return spread("samples", "getup")


@pytest.mark.parametrize("devices", [2, 4])
def test_the_same_samples_give_the_state_of_one_device(found, devices):
    samples = found["samples"]
    assert samples["moved"] > 1e-3
    assert samples[f"state {devices}"] < ROUNDING
    assert samples[f"metrics {devices}"] < ROUNDING


# of two iterations that begin with the same simulations on every device
EXPECTED = {
    "finite": True,
    "same on all": True,  # networks, statistics, counters
    "parts differ": True,  # every device draws its own noise and starts
    "programs": 1,  # compiled once
    "physics": 0.0,
}


def test_getting_up_on_four_devices(found):
    assert found["getup"] == EXPECTED


@pytest.mark.slow
def test_composite_motion_on_two_devices():
    assert spread("composite")["composite"] == EXPECTED
