"""Two real processes on one machine, joined by JAX's distributed runtime."""

from __future__ import annotations

import os
import sys
import time

import jax
import numpy as np
import pytest
from launching import STEPS

from getup_jax.runtime import checkpoint
from getup_jax.runtime.metric_file import read_metrics

ITERATIONS = 5
# The gradients of two processes are summed by gloo, those of two devices by XLA, and both add two
# numbers: what is left are programs that XLA has compiled for one device or for two.
ROUNDING = 2e-5


def total(iterations: int) -> str:
    return f"train.total_steps={iterations * STEPS}"


@pytest.fixture(scope="module")
def finished(launch, tmp_path_factory):
    """A run of two processes, and the same one of two devices of one process."""
    folder, alone = tmp_path_factory.mktemp("two"), tmp_path_factory.mktemp("alone")
    two = [process.end() for process in launch.two(folder, total(ITERATIONS))]
    one = launch.one(alone, total(ITERATIONS), devices=2).end()
    return folder, two, alone, one


def test_the_first_process_alone_talks_and_writes(finished):
    folder, two, _, _ = finished
    assert [process.code for process in two] == [0, 0], two[0].err + two[1].err
    assert "2 x cpu in 2 processes" in two[0].out
    assert two[0].out.count("compiling") == 1
    # gloo says on its own that it has connected
    assert [x for x in two[1].out.splitlines() if not x.startswith("[Gloo]")] == []
    assert [process.err for process in two] == ["", ""]
    assert [row["iteration"] for row in read_metrics(folder)] == list(range(1, ITERATIONS + 1))


def test_two_processes_learn_what_two_devices_of_one_do(finished):
    folder, _, alone, one = finished
    assert one.code == 0, one.err
    found, expected = (checkpoint.load_learner(path) for path in (folder, alone))
    for part in ("learner", "environment"):
        a, b = getattr(found, part), getattr(expected, part)
        assert jax.tree.structure(a) == jax.tree.structure(b)
        for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
            np.testing.assert_allclose(x, y, rtol=ROUNDING, atol=ROUNDING)


def test_a_run_goes_on_with_other_numbers_of_processes_and_devices(launch, finished):
    folder, *_ = finished
    more = ("--resume", total(ITERATIONS + 2))
    after = launch.one(folder, *more, devices=4).end()
    assert after.code == 0, after.err
    assert f"resuming from {folder}" in after.out
    rows = read_metrics(folder)
    assert [row["iteration"] for row in rows] == list(range(1, ITERATIONS + 3))
    assert all(np.isfinite(row["loss/value"]) for row in rows)


@pytest.mark.parametrize("killed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_killed_process_ends_the_other_and_the_run_resumes(launch, tmp_path, killed):
    processes = launch.two(tmp_path, total(10_000_000), "train.save_every_s=0.2")
    wait_for(lambda: checkpoint.steps(tmp_path / "checkpoints"), processes)
    if sys.platform == "linux":  # or gloo's thread takes the core from the one that it waits for
        policies = [os.sched_getscheduler(process.popen.pid) for process in processes]
        assert policies == [os.SCHED_BATCH] * 2
    processes[killed].popen.kill()
    left = processes[1 - killed].end(timeout_s=60)
    assert left.code != 0
    assert len(left.err.splitlines()) == 1, left.err
    assert left.err.startswith("ProcessError: ")
    assert "another process of this run is gone" in left.err
    assert "--resume" in left.err
    done = int(checkpoint.steps(tmp_path / "checkpoints")[-1].name)
    after = launch.one(tmp_path, "--resume", total(done + 1)).end()
    assert after.code == 0, after.err
    assert [row["iteration"] for row in read_metrics(tmp_path)] == list(range(1, done + 2))


def wait_for(condition, processes, timeout_s: float = 200.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition():
        ended = [p for p in processes if p.popen.poll() is not None]
        assert not ended, ended[0].end()
        assert time.monotonic() < deadline, "nothing was saved"
        time.sleep(0.1)
