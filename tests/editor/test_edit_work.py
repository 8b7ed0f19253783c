"""Imports that nobody waits for any more, and what must not wait for imports."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import time
import types

import pytest
from edit_running import CURVE, Quick, request, running, socket

from getup_jax.config import PhysicsConfig
from getup_jax.editor import export
from getup_jax.editor.messages import pack
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
        for page in pages:
            importing(page)
        assert until(lambda: len(alive(pids)) == SLOW)
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


def test_a_film_that_nobody_waits_for_ends_between_two_pictures(monkeypatch, tmp_path):
    shown, stop = [], Stop()

    class Writer:
        def append_data(self, image):
            shown.append(image)
            stop.set()

    writer = contextlib.nullcontext(Writer())
    imageio = types.SimpleNamespace(get_writer=lambda *_, **__: writer)
    monkeypatch.setattr(film, "require", lambda: imageio)
    monkeypatch.setattr(film, "pictures", lambda *_: iter(range(1000)))
    monkeypatch.setattr(film, "caption", lambda image, text: image)
    frames = types.SimpleNamespace(qpos=None)
    motion = types.SimpleNamespace(
        frames=frames, control_dt=0.1, curve=types.SimpleNamespace(name=CURVE["name"])
    )
    with pytest.raises(AbandonedError):
        export.export(motion, CHARACTER, "mp4", stop)
    assert shown == [0]
