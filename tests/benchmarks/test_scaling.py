from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import gpu_checks
import scaling
from support.projection import Iteration, Network, efficiency, iteration_s, reduction_s

ROOT = Path(__file__).parent.parent.parent
NETWORK = Network(latency_s=1e-3, bytes_per_s=1e6)


def test_a_reduction_of_two_sends_a_message_and_the_bytes_either_way():
    assert reduction_s(1e6, 2, NETWORK) == pytest.approx(2e-3 + 1.0)


def test_messages_grow_with_the_logarithm_and_bytes_to_twice_the_size():
    assert reduction_s(0, 64, NETWORK) == pytest.approx(12e-3)
    assert reduction_s(0, 65, NETWORK) == pytest.approx(14e-3)
    assert reduction_s(1e6, 10**6, NETWORK) == pytest.approx(2.04, rel=1e-3)


def test_efficiency_is_that_of_the_time():
    of = Iteration(compute_s=1.0, gradient_bytes=1e6, updates=2)
    assert efficiency(of, 1, NETWORK) == 1.0
    assert iteration_s(of, 2, NETWORK) == pytest.approx(3.004)
    assert efficiency(of, 2, NETWORK) == pytest.approx(1 / 3.004)


def test_ratios_are_of_the_same_round():
    about = {
        "parameters": {"actor": 100, "critic": 300},
        "updates": {"actor": 4, "critic": 6},
        "steps": 10,
        "reduction_s": 0.1,
        "smallest_reduction_s": 0.05,
    }
    double = {**about, "steps": 20}
    found = scaling.report(
        {"one": about, "two": double, "strong": about, "both": double, "apart": double},
        {
            "one": [1.0, 3.0, 2.0],
            "two": [1.0, 3.0, 4.0],
            "strong": [1.0] * 3,
            "both": [1.0] * 3,
            "apart": [0.5, 0.5, 1.0],
        },
    )
    assert found["ratios"]["weak"] == 2.0
    assert found["ratios"]["strong"] == 2.0
    assert found["ratios"]["of the machine"] == 4.0
    assert found["ratios"]["of two apart"] == 0.25
    assert found["iteration"] == {
        "compute_s": 2.0,
        "gradient_bytes": pytest.approx((4 * 400 + 6 * 1200) / 6),
        "updates": 6,  # in four of them actor and critic are one message
        "bytes": pytest.approx(8800),
    }


def test_the_rate_of_a_run_is_that_of_its_second_half(tmp_path):
    assert gpu_checks.rate(tmp_path) is None
    rows = [{"iteration": i, "steps_per_s": float(i)} for i in range(1, 5)]
    (tmp_path / "times.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert gpu_checks.rate(tmp_path) == 3.5


@pytest.mark.slow
@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="pins processes to two CPUs")
def test_two_processes_are_timed(tmp_path):
    file = tmp_path / "found.json"
    words = ["benchmarks/scaling.py", "--quick", "--rounds", "2", "--json", str(file)]
    done = subprocess.run(
        [sys.executable, *words], cwd=ROOT, capture_output=True, text=True, timeout=1200
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(file.read_text())
    assert set(found["ratios"]) == set(scaling.RATIOS)
    assert all(rate > 0 for rate in found["control steps/s"].values())
    assert found["reduction_s"] > 0
