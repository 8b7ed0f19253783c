from __future__ import annotations

import dataclasses
import json
import struct
import threading
import time

import numpy as np
import pytest
from edit_samples import make_curve, whole_motion

from getup_jax.editor import session as sessions
from getup_jax.editor.messages import Request
from getup_jax.editor.session import Session
from getup_jax.editor.verdict import verdict

NUMBERS = 20 * 7 + 4  # of a frame: links, features, running


class Slow:
    """A simulator whose chunks wait to be let through."""

    def __init__(self, real) -> None:
        self.real, self.gate, self.chunks = real, threading.Event(), 0

    def __getattr__(self, name):
        return getattr(self.real, name)

    def run(self, curve, place):
        for part in self.real.run(curve, place):
            self.gate.wait(30)
            self.chunks += 1
            yield part


class Box:
    """What a page was sent."""

    def __init__(self) -> None:
        self.got: list[dict] = []
        self.done = threading.Event()

    def __call__(self, message: str | bytes) -> None:
        self.got.append(header(message))
        if isinstance(message, str) and json.loads(message)["type"] in ("result", "error"):
            self.done.set()


def header(message: str | bytes) -> dict:
    if isinstance(message, str):
        return json.loads(message)
    (length,) = struct.unpack_from("<I", message)
    found = json.loads(message[4 : 4 + length])
    payload = np.frombuffer(message[4 + length :], "<f4")
    assert payload.size == found["count"] * NUMBERS
    return found


@pytest.fixture
def session(simulator):
    session = Session(Slow(simulator))
    yield session
    session.simulator.gate.set()
    session.stop()


def ask(number: int, height: float = 1.4, slot: int = 0) -> Request:
    return Request("simulate", number, slot, make_curve(height))


def test_frames_come_first_and_then_the_result(session):
    box = Box()
    session.simulator.gate.set()
    session.submit(0, ask(7), box)
    assert box.done.wait(60)
    *frames, result = box.got
    assert [f["type"] for f in frames] == ["frames"] * len(frames)
    assert sum(f["count"] for f in frames) == frames[0]["total"]
    assert (result["type"], result["number"]) == ("result", 7)
    assert result["success"] is False
    assert result["stands"] is False
    assert result["verdict"].startswith("fails at")
    assert session.motion(ask(8)).scores["energy_j"] == result["scores"]["energy_j"]


def test_on_one_core_the_page_draws_before_the_rest_is_made(session, monkeypatch):
    monkeypatch.setattr(sessions, "cpus", lambda: 1)
    monkeypatch.setattr(sessions, "_PAGE_DRAWS_S", 30.0)
    first, second = Box(), Box()
    session.simulator.gate.set()
    session.submit(0, ask(1), first)
    deadline = time.monotonic() + 60
    while not first.got and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.2)
    assert [f["first"] for f in first.got] == [0], "the rest waits"
    session.submit(0, ask(2), second)  # a newer edit does not
    while not second.got and time.monotonic() < deadline:
        time.sleep(0.01)
    assert [f["first"] for f in second.got] == [0]
    assert len(first.got) == 1


def test_a_new_edit_cancels_the_old_one(session):
    old, new = Box(), Box()
    session.submit(0, ask(1), old)
    deadline = time.monotonic() + 30
    while session._current is None and time.monotonic() < deadline:
        time.sleep(0.01)
    session.submit(0, ask(2, 0.9), new)
    session.simulator.gate.set()
    assert new.done.wait(60)
    assert old.got == []
    whole = len(list(session.simulator.real.run(make_curve())))
    assert session.simulator.chunks == whole + 1  # one chunk of the old one was under way


def test_other_variants_and_pages_wait_for_their_turn(session):
    boxes = [Box(), Box(), Box()]
    for box, (page, slot) in zip(boxes, [(0, 0), (0, 1), (1, 0)], strict=True):
        session.submit(page, ask(3, slot=slot), box)
    session.simulator.gate.set()
    assert all(box.done.wait(60) for box in boxes)


def test_a_page_that_leaves_is_forgotten_and_an_error_stops_no_other(session):
    left, bad, good = Box(), Box(), Box()
    session.submit(0, ask(1), left)
    session.forget(0)
    session.submit(1, Request("simulate", 2, 0, make_curve(start="nothing")), bad)
    session.submit(2, ask(3), good)
    session.simulator.gate.set()
    assert bad.done.wait(60)
    assert good.done.wait(60)
    assert left.got == []
    assert "start: expected one of clip" in bad.got[-1]["text"]
    assert good.got[-1]["type"] == "result"


def test_a_verdict_says_how_the_episode_ended(motion):
    frames = dataclasses.replace(motion.frames, running=np.ones(len(motion.time), bool))
    stays = dataclasses.replace(motion, frames=frames)
    assert verdict(stays) == "does not stand at the end"
    stands = dataclasses.replace(motion, scores={"success": 1.0, "stand_time_s": 2.34})
    assert verdict(stands) == "stands after 2.3 s"
    running = np.arange(len(motion.time)) < 12
    frames = dataclasses.replace(motion.frames, running=running)
    low = dataclasses.replace(motion, frames=frames, task_reward=np.full(len(running), 0.05))
    assert verdict(low).startswith("too far from the curves at 0.4 s (")
    head = dataclasses.replace(low, task_reward=np.full(len(running), 0.5))
    assert verdict(head) == "fails at 0.4 s: head on the floor"


def test_what_nobody_watches_is_simulated_between_edits_and_is_the_same(session, simulator):
    wanted = whole_motion(simulator, make_curve(1.1))
    slow, box, found = session.simulator, Box(), []
    other = threading.Thread(
        target=lambda: found.append(session.motion(Request("judge", 1, 0, make_curve(1.1))))
    )
    other.start()
    slow.gate.set()
    session.submit(0, ask(2), box)
    assert box.done.wait(60)
    other.join(60)
    np.testing.assert_array_equal(found[0].frames.qpos, wanted.frames.qpos)
    assert box.got[-1]["type"] == "result"


def test_chunks_of_two_motions_may_take_turns(simulator):
    curves = make_curve(1.1), make_curve(1.4)
    wanted = [whole_motion(simulator, curve).frames.qpos for curve in curves]
    runs = [simulator.run(curve) for curve in curves]
    found = [[], []]
    for parts in zip(*runs, strict=True):
        for i, part in enumerate(parts):
            if not hasattr(part, "scores"):
                found[i].append(part.qpos)
    for qpos, alone in zip(found, wanted, strict=True):
        np.testing.assert_array_equal(np.concatenate(qpos), alone)


def test_an_abandoned_motion_ends_between_two_chunks(session):
    session.simulator.gate.set()

    def check():
        if session.simulator.chunks:
            raise TimeoutError

    with pytest.raises(TimeoutError):
        session.motion(Request("judge", 1, 0, make_curve(1.1)), check)
    assert session.simulator.chunks == 1
