from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

# As a training does: it says so when it is ready and with every step, and writes what it saves.
LOOP = """
import pathlib, sys, time
from getup_jax.runtime.console import Display
from getup_jax.runtime.signals import StopRequest
with Display(10**6) as display, StopRequest(display.log) as stop:
    with stop.armed():
        display.start(0)
        pathlib.Path(sys.argv[1], "ready").touch()
        left = int(sys.argv[2])
        for step in range(800):
            display.update(step, 1.0, {})
            time.sleep(0.05)
            left -= stop.signal is not None
            if left < 0:
                break
    pathlib.Path(sys.argv[1], "saved").write_text(str(stop.signal))
    display.close()
    display.log("saved")
sys.exit(0 if stop.signal is None else 128 + stop.signal)
"""
LONG = "40"  # steps of a twentieth of a second: the loop goes on for so long after a signal


@contextmanager
def looping(folder: Path, steps: str = "0", **options) -> Iterator[subprocess.Popen[bytes]]:
    """LOOP in a process group of its own, once it is ready for signals."""
    options = {"start_new_session": True, "stderr": subprocess.DEVNULL} | options
    command = [sys.executable, "-c", LOOP, str(folder), steps]
    with subprocess.Popen(command, **options) as process:
        try:
            until(lambda: (folder / "ready").exists())
            yield process
        finally:
            process.kill()


def until(condition) -> None:
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def saved(folder: Path) -> str | None:
    file = folder / "saved"
    return file.read_text() if file.exists() else None


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_saves(tmp_path, number):
    with looping(tmp_path, stdout=subprocess.DEVNULL) as process:
        process.send_signal(number)
        assert process.wait(60) == 128 + number
    assert saved(tmp_path) == str(int(number))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_same_signal_to_the_process_and_to_its_group_is_one(tmp_path, number):
    with looping(tmp_path, LONG, stdout=subprocess.DEVNULL) as process:
        process.send_signal(number)
        time.sleep(0.2)
        os.killpg(process.pid, number)
        assert process.wait(60) == 128 + number
    assert saved(tmp_path) == str(int(number))


def test_timeout_s_two_signals_save(tmp_path):
    command = ["timeout", "-s", "INT", "8", sys.executable, "-c", LOOP, str(tmp_path), LONG]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, start_new_session=True, check=False)
    assert done.returncode == 124
    assert saved(tmp_path) == str(int(signal.SIGINT))


def test_a_second_ctrl_c_that_comes_later_exits_at_once(tmp_path):
    with looping(tmp_path, LONG, stdout=subprocess.DEVNULL) as process:
        process.send_signal(signal.SIGINT)
        time.sleep(1.3)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 128 + signal.SIGINT
    assert saved(tmp_path) is None


def test_a_later_hangup_or_termination_is_no_impatience(tmp_path):
    with looping(tmp_path, LONG, stdout=subprocess.DEVNULL) as process:
        for number in (signal.SIGTERM, signal.SIGHUP):
            process.send_signal(number)
            time.sleep(0.3)  # those that wait come by their number, not in their order
        time.sleep(1.3)
        for number in (signal.SIGTERM, signal.SIGHUP):
            process.send_signal(number)
        assert process.wait(60) == 128 + signal.SIGTERM
    assert saved(tmp_path) == str(int(signal.SIGTERM))


def in_terminal(path: str):
    """What makes a terminal the controlling one of a new process."""

    def prepare() -> None:
        os.setsid()
        for descriptor in (0, 1, 2):
            os.dup2(os.open(path, os.O_RDWR), descriptor)

    return prepare


def test_closing_the_terminal_saves(tmp_path):
    terminal, other = pty.openpty()
    options = {"start_new_session": False, "stderr": None}
    with looping(tmp_path, preexec_fn=in_terminal(os.ttyname(other)), **options) as process:
        os.close(other)
        assert b"steps" in os.read(terminal, 10_000)
        os.close(terminal)
        assert process.wait(60) == 128 + signal.SIGHUP
    assert saved(tmp_path) == str(int(signal.SIGHUP))


def test_what_nohup_has_switched_off_stays_off(tmp_path):
    command = ["nohup", sys.executable, "-c", LOOP, str(tmp_path), "0"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        until(lambda: (tmp_path / "ready").exists())
        process.send_signal(signal.SIGHUP)
        time.sleep(0.5)
        assert process.poll() is None
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 128 + signal.SIGTERM


def test_a_reader_that_went_away_costs_nothing(tmp_path):
    with looping(tmp_path, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.close()
        time.sleep(0.5)
        assert process.poll() is None
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 128 + signal.SIGTERM
    assert saved(tmp_path) == str(int(signal.SIGTERM))
