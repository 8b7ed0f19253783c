"""Imports that nobody waits for any more, and what must not wait for imports."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import time
import types

import numpy as np
import pytest
from edit_running import Quick, request, running, socket

from getup_jax.config import PhysicsConfig
from getup_jax.editor import export
from getup_jax.editor.messages import pack
from getup_jax.editor.takes import Cut
from getup_jax.editor.work import SLOW
from getup_jax.evaluation import film
from getup_jax.motion.retarget.subprocess_job import AbandonedError, Stop
from getup_jax.physics.character import load_character

CHARACTER = load_character(PhysicsConfig())


@pytest.fixture
def pids(tmp_path, monkeypatch):
    """A folder with a file for each worker that was started; workers take a minute here."""
    folder = tmp_path / "workers"
    folder.mkdir()
    slow = tmp_path / "python"
    slow.write_text(f'#!/bin/sh\ntouch "{folder}/$$"\nexec sleep 60\n')
    slow.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(slow))
    monkeypatch.setenv("GETUP_JAX_CACHE", str(tmp_path / "cache"))
    yield folder
    for pid in alive(folder):
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, 9)


@pytest.fixture
def site(pids):
    simulator = types.SimpleNamespace(character=CHARACTER)
    with running(lambda log: (Quick(simulator), {})) as server:
        yield server.wait(2)


def alive(folder) -> list[int]:
    """Those that run, or that nobody has waited for."""
    found = []
    for pid in (int(file.name) for file in folder.iterdir()):
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, 0)
            found.append(pid)
    return found


def until(condition, seconds: float = 20.0) -> bool:
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
    return condition()


def importing(page, number: int = 1) -> None:
    """Ask for an import; each is of another file, so that none is in the cache."""
    head = {"type": "import", "number": number, "name": f"take {time.monotonic_ns()}.bvh"}
    page.send(pack(head, b"HIERARCHY"))


def opened(stack: contextlib.ExitStack, site):
    page = stack.enter_context(socket(site))
    page.recv(timeout=30)
    return page


def test_a_page_that_closes_ends_its_import(site, pids):
    with contextlib.ExitStack() as stack:
        importing(opened(stack, site))
        assert until(lambda: len(alive(pids)) == 1)
    assert until(lambda: not alive(pids))


def test_abandoned_imports_leave_no_more_than_two_at_once(site, pids):
    most = 0
    for number in range(6):
        with contextlib.ExitStack() as stack:
            importing(opened(stack, site))
            until(lambda number=number: len(list(pids.iterdir())) > number, 3.0)
            most = max(most, len(alive(pids)))
    assert 1 <= most <= SLOW
    assert until(lambda: not alive(pids))


def test_pages_share_two_imports_and_a_save_waits_for_none(site, pids):
    with contextlib.ExitStack() as stack:
        pages = [opened(stack, site) for _ in range(3)]
        for page in pages[:SLOW]:
            importing(page)
        assert until(lambda: len(alive(pids)) == SLOW)
        importing(pages[SLOW])  # once the others have their workers: pages are served in any order
        pages[0].send(request(type="save"))
        assert isinstance(pages[0].recv(timeout=30), bytes)
        first = alive(pids)  # they take a minute
        assert len(first) == SLOW
        pages[0].close()
        pages[1].close()
        assert until(lambda: len(alive(pids)) == 1 and set(alive(pids)).isdisjoint(first))


def test_a_page_has_two_imports_at_once(site, pids):
    with contextlib.ExitStack() as stack:
        page = opened(stack, site)
        for number in range(3):
            importing(page, number)
        answer = json.loads(page.recv(timeout=30))
        assert (answer["number"], answer["of"]) == (2, "import")
        assert "busy with earlier files" in answer["text"]


def test_a_server_that_ends_leaves_no_worker_behind(pids):
    simulator = types.SimpleNamespace(character=CHARACTER)
    with contextlib.ExitStack() as stack:
        with running(lambda log: (Quick(simulator), {})) as server:
            importing(opened(stack, server.wait(2)))
            assert until(lambda: len(alive(pids)) == 1)
            begin = time.monotonic()
        assert time.monotonic() - begin < 20
        assert until(lambda: not alive(pids))


def test_a_page_cancels_what_it_asked_for_and_no_other_page_does(site, pids):
    with contextlib.ExitStack() as stack:
        page, other = opened(stack, site), opened(stack, site)
        importing(page, 7)
        assert until(lambda: len(alive(pids)) == 1)
        other.send(json.dumps({"type": "cancel", "number": 8, "of": 7}))
        other.send(request(type="save"))
        other.recv(timeout=30)
        assert len(alive(pids)) == 1
        page.send(json.dumps({"type": "cancel", "number": 8, "of": 7}))
        answer = json.loads(page.recv(timeout=30))
        assert (answer["type"], answer["number"], answer["text"]) == ("error", 7, "cancelled")
        assert until(lambda: not alive(pids))


class Writer:
    """Takes pictures as a film would, and calls for each of them."""

    def __init__(self, call) -> None:
        self.shown, self._call = [], call

    def append_data(self, image):
        self.shown.append(image)
        self._call()


@pytest.fixture
def filmed(monkeypatch):
    """Films the standing character for a second, without a renderer."""

    def run(writer: Writer, stop: Stop, cut: Cut, progress=lambda share: None):
        imageio = types.SimpleNamespace(get_writer=lambda *_, **__: contextlib.nullcontext(writer))
        camera = types.SimpleNamespace(picture=lambda row, seen: seen.azimuth, close=lambda: None)
        monkeypatch.setattr(film, "require", lambda: imageio)
        monkeypatch.setattr(film, "Camera", lambda model, size: camera)
        qpos = np.tile(CHARACTER.neutral_qpos, (30, 1))
        motion = types.SimpleNamespace(
            frames=types.SimpleNamespace(qpos=qpos),
            start_pose=qpos[0],
            control_dt=1 / 30,
            curve=types.SimpleNamespace(name="line"),
        )
        export.export(motion, CHARACTER, "mp4", cut, stop, progress)

    return run


def test_a_film_that_nobody_waits_for_ends_between_two_pictures(filmed):
    stop = Stop()
    writer = Writer(stop.set)
    with pytest.raises(AbandonedError):
        filmed(writer, stop, Cut())
    assert len(writer.shown) == 1


def test_a_film_says_how_much_is_done_and_turns_once(filmed, tmp_path, monkeypatch):
    shares: list[float] = []
    writer = Writer(lambda: None)
    monkeypatch.setattr(export.Path, "read_bytes", lambda path: b"film")
    filmed(writer, Stop(), Cut(24, 0.0, 0.5, turn=True), shares.append)
    assert shares == pytest.approx(np.arange(1, 14) / 13)
    turned = np.diff(writer.shown)
    assert len(writer.shown) == 13
    np.testing.assert_allclose(turned, 360 / 13)
