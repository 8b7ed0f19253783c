"""What keeps processes from being one run is said in one line by each."""

from __future__ import annotations

import pytest
from launching import STEPS, free_port

TOTAL = f"train.total_steps={STEPS}"


def one_line(text: str) -> str:
    assert len(text.splitlines()) == 1, text
    return text


def test_a_coordinator_that_is_not_there(launch, tmp_path):
    address = f"127.0.0.1:{free_port()}"
    options = ["--coordinator", address, "--processes", "2", "--process", "1", "--wait", "1"]
    ended = launch.one(tmp_path / "run", *options).end()
    assert ended.code == 2
    assert f"--coordinator {address}: not reached within 1 s" in one_line(ended.err)


def test_a_process_that_does_not_come(launch, tmp_path):
    address = f"127.0.0.1:{free_port()}"
    options = ["--coordinator", address, "--processes", "2", "--process", "0", "--wait", "1"]
    ended = launch.one(tmp_path / "run", *options).end()
    assert ended.code == 3
    assert "not all 2 processes came together" in one_line(ended.err)
    assert not (tmp_path / "run").exists()


def test_devices_that_do_not_divide(launch, tmp_path):
    ended = launch.one(tmp_path, TOTAL, devices=3).end()
    assert ended.code == 2
    expected = "ppo.num_envs: expected a multiple of the number of devices, 3, got 16; set "
    assert expected + "ppo.num_envs=18" in one_line(ended.err)


@pytest.mark.parametrize("kind", ["settings", pytest.param("folder", marks=pytest.mark.slow)])
def test_processes_that_are_not_one_run(launch, tmp_path, kind):
    address = f"127.0.0.1:{free_port()}"
    both = ["--coordinator", address, "--processes", "2", "--process"]
    other = {"settings": (tmp_path / "0", "seed=1"), "folder": (tmp_path / "1",)}[kind]
    first = launch.one(tmp_path / "0", TOTAL, *both, "0")
    second = launch.one(other[0], TOTAL, *other[1:], *both, "1")
    text = {
        "settings": "process 1 has other settings than process 0; start all with the same CONFIG",
        "folder": "process 1 does not see what process 0 wrote; --run must name a folder on",
    }[kind]
    for ended in (first.end(), second.end()):
        assert ended.code == 2
        assert text in one_line(ended.err)
