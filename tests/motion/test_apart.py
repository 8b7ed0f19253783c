"""Processes of their own: their ends, their limits, and what is said of them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.readers import ReadOptions
from getup_jax.motion.retarget.cache import retarget_files
from getup_jax.motion.retarget.job import Job
from getup_jax.motion.retarget.retarget import RetargetSettings
from getup_jax.motion.retarget.subprocess_job import AbandonedError, Stop, Worker, run_apart
from getup_jax.physics.character import load_character

CHARACTER = load_character(PhysicsConfig())


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("GETUP_JAX_CACHE", str(tmp_path / "cache"))


def job(folder, name="walk.bvh", text="x") -> Job:
    path = folder / name
    path.write_text(text)
    return Job(path, CHARACTER, ReadOptions(), RetargetSettings())


def stand_in(folder, monkeypatch, script: str) -> None:
    """Workers run the script instead of Python."""
    python = folder / "python"
    python.write_text(f"#!/bin/sh\n{script}\n")
    python.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(python))


@pytest.mark.parametrize(
    ("script", "text"),
    [
        ("kill -9 $$", r"walk\.bvh: retargeting was ended by SIGKILL, perhaps for want of memory"),
        ("exit 3", r"walk\.bvh: retargeting ended with exit code 3: without a word"),
        (
            "printf 'Traceback (most recent call last):\\n  File\\nKeyError: 5\\n\\n' >&2; exit 1",
            r"walk\.bvh: retargeting ended with exit code 1: KeyError: 5",
        ),
        ("exit 0", r"walk\.bvh: expected a motion, got content that makes no sense \(EOFError\)"),
        ("head -c 100000 /dev/zero", r"walk\.bvh: expected a motion, got content"),
    ],
)
def test_a_worker_that_gives_no_result_is_one_line(tmp_path, monkeypatch, script, text):
    stand_in(tmp_path, monkeypatch, script)
    with pytest.raises(MotionError, match=text) as caught:
        run_apart(job(tmp_path))
    assert "\n" not in str(caught.value)
    assert "Traceback" not in str(caught.value)
    assert str(tmp_path) not in str(caught.value)


def test_a_stop_ends_the_process_and_waits_for_it(tmp_path, monkeypatch):
    stand_in(tmp_path, monkeypatch, f'echo $$ > "{tmp_path}/pid"; exec sleep 60')
    stop, pid = Stop(), tmp_path / "pid"
    timer = threading.Thread(
        target=lambda: (wait_for(lambda: pid.exists() and pid.read_text()), stop.set())
    )
    begin = time.monotonic()
    timer.start()
    with pytest.raises(AbandonedError):
        run_apart(job(tmp_path), stop)
    assert time.monotonic() - begin < 30
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)
    pid.unlink()
    with pytest.raises(AbandonedError):
        run_apart(job(tmp_path), stop)
    assert not pid.exists()


def test_one_process_takes_one_file_after_the_other(tmp_path, monkeypatch):
    started: list[list[str]] = []
    popen = subprocess.Popen

    def counted(command, **options):
        started.append(command)
        return popen(command, **options)

    monkeypatch.setattr(subprocess, "Popen", counted)
    with Worker() as worker:
        for name in ("one.bvh", "two.bvh"):
            with pytest.raises(MotionError, match=rf"^{name}, line 1: "):
                worker.run(job(tmp_path, name))
    assert len(started) == 1


def test_a_worker_that_has_ended_is_started_anew(tmp_path, monkeypatch):
    stand_in(tmp_path, monkeypatch, f'echo x >> "{tmp_path}/starts"; kill -9 $$')
    jobs = [job(tmp_path, f"{number}.bvh", str(number)) for number in range(3)]
    done: list[str] = []
    results = retarget_files(jobs, 1, lambda path, result: done.append(path.name))
    for number, result in enumerate(results):
        assert isinstance(result, MotionError)
        assert str(result).startswith(f"{number}.bvh: retargeting was ended by SIGKILL")
    assert (tmp_path / "starts").read_text().count("x") == 3
    assert done == ["0.bvh", "1.bvh", "2.bvh"]


def test_ctrl_c_waits_for_no_file(tmp_path, monkeypatch):
    pid = tmp_path / "pid"
    stand_in(tmp_path, monkeypatch, f'echo $$ > "{pid}"; exec sleep 60')
    jobs = [job(tmp_path, f"{number}.bvh", str(number)) for number in range(3)]
    done: list[str] = []
    main = threading.current_thread().ident
    assert main is not None

    def interrupt() -> None:
        wait_for(lambda: pid.exists() and pid.read_text())
        signal.pthread_kill(main, signal.SIGINT)

    begin = time.monotonic()
    threading.Thread(target=interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        retarget_files(jobs, 1, lambda path, result: done.append(path.name))
    assert time.monotonic() - begin < 30
    assert done == []
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)


def wait_for(condition, seconds: float = 20.0) -> bool:
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
    return bool(condition())


def test_a_real_worker_says_what_is_wrong_with_a_file(tmp_path):
    text = '{"fps": 30, "frames": ' + "[" * 50_000 + "]" * 50_000 + "}"
    with pytest.raises(MotionError, match=r"^a\.json: expected") as caught:
        run_apart(job(tmp_path, "a.json", text), memory=4_000_000_000)
    assert str(tmp_path) not in str(caught.value)


CHILD = """
import sys, time
from getup_jax.motion.retarget.worker import end_with_parent
end_with_parent()
print("ready", flush=True)
time.sleep(60)
"""
PARENT = "import subprocess, sys; subprocess.run([sys.executable, '-c', sys.argv[1]])"


def test_a_worker_ends_with_the_one_who_started_it():
    command = [sys.executable, "-c", PARENT, f"import os; print(os.getpid(), flush=True)\n{CHILD}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        try:
            assert parent.stdout.readline() == "ready\n"
            parent.kill()
            assert parent.stdout.read() == ""  # its end: the child held the pipe, too
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, 9)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not keep the limit")
def test_a_worker_takes_no_more_memory_than_it_may():
    script = """
from getup_jax.motion.io.guard import one_line
from getup_jax.motion.retarget.worker import limit_memory
limit_memory(2_000_000_000)
with one_line("a.bvh"):
    bytearray(3_000_000_000)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    last = done.stderr.strip().split("\n")[-1]
    assert last.endswith(
        "MotionError: a.bvh: needs more memory than there is; cut it into shorter files"
    )
