"""The thread behind the pages: never far ahead of them, a character each, and no page ends it."""

from __future__ import annotations

import json
import threading
import time
import types

import numpy as np
import pytest
from edit_running import running, socket
from websockets.exceptions import ConnectionClosed

from getup_jax.editor.messages import MessageError
from getup_jax.editor.steer import session as sessions
from getup_jax.editor.steer.app import SteerApp
from getup_jax.editor.steer.character import Frame
from getup_jax.editor.steer.messages import Request
from getup_jax.editor.steer.session import AHEAD, Session


class Walker:
    """A character whose frames say what it was asked."""

    def __init__(self, players, rising, seed):
        self.asked, self.seed, self.name = [], seed, next(iter(players))

    def step(self):
        if "push" in self.asked:
            raise ZeroDivisionError("it broke")
        return Frame(np.zeros((1, 7), np.float32), {"asked": list(self.asked), "name": self.name})

    def order(self, goal, order):
        self.asked.append(goal)

    def switch(self, name):
        self.name = name

    def push(self, yaw):
        self.asked.append("push")

    def restart(self):
        self.asked.clear()


class Offered:
    """Policies of which one is compiled."""

    def __init__(self):
        self.players, self.rising, self.go = {"walk": 1}, None, threading.Event()
        self.offers = {"walk": 1, "aim": 2, "broken": 3}

    def load(self, name, log):
        log("compiling ...")
        assert self.go.wait(10)
        if name == "broken":
            raise MessageError("broken: cannot be compiled")
        self.players[name] = 2

    def describe(self):
        return [{"name": name, "ready": name in self.players} for name in self.offers]


class Listener:
    """What one page was sent."""

    def __init__(self, session: Session, page: int) -> None:
        self.session, self.page, self.got = session, page, []

    def say(self, kind: str, **values) -> None:
        self.session.submit(self.page, Request(kind, **values), self.hear)

    def hear(self, message):
        self.got.append(json.loads(message if isinstance(message, str) else _head(message)))

    def of(self, kind: str) -> list[dict]:
        return [message for message in list(self.got) if message["type"] == kind]

    def wait(self, kind: str, count: int) -> list[dict]:
        deadline = time.monotonic() + 10
        while len(self.of(kind)) < count and time.monotonic() < deadline:
            time.sleep(0.005)
        time.sleep(0.05)  # more than was waited for would be here, too
        return self.of(kind)


def _head(message: bytes) -> bytes:
    return message[4 : 4 + int.from_bytes(message[:4], "little")]


@pytest.fixture
def session(monkeypatch):
    monkeypatch.setattr(sessions, "Character", Walker)
    made = Session(Offered())
    yield made
    made.stop()


def test_it_simulates_as_the_page_shows_and_stops_where_that_does(session):
    page = Listener(session, 1)
    page.say("begin")
    assert [f["number"] for f in page.wait("frame", AHEAD)] == list(range(1, AHEAD + 1))
    page.say("shown", number=4)
    assert len(page.wait("frame", AHEAD + 4)) == AHEAD + 4
    page.say("shown", number=10_000)  # no more than there are
    assert len(page.wait("frame", 2 * AHEAD + 4)) == 2 * AHEAD + 4
    page.say("order", name="aiming", order={})
    page.say("shown", number=11)
    frames = page.wait("frame", 2 * AHEAD + 5)
    assert "aiming" in frames[-1]["asked"]  # in the next frame that is simulated
    page.say("restart")
    page.say("shown", number=12)
    assert page.wait("frame", 2 * AHEAD + 6)[-1]["asked"] == []


def test_a_policy_is_compiled_when_it_is_first_asked_for(session):
    page, other = Listener(session, 1), Listener(session, 2)
    for one in (page, other):
        one.say("begin")
        one.wait("frame", AHEAD)
    page.say("policy", name="aim")
    assert page.wait("loading", 1)[0]["name"] == "aim"
    page.say("shown", number=3)
    assert page.wait("frame", AHEAD + 3)[-1]["name"] == "walk"  # it goes on meanwhile
    session.policies.go.set()
    for one in (page, other):
        assert one.wait("policies", 1)[0]["policies"][1] == {"name": "aim", "ready": True}
        one.say("shown", number=6)
    assert page.wait("frame", AHEAD + 6)[-1]["name"] == "aim"
    assert other.wait("frame", AHEAD + 6)[-1]["name"] == "walk"
    page.say("policy", name="broken")
    assert page.wait("error", 1)[0]["text"] == "broken: cannot be compiled"
    page.say("policy", name="nobody")
    assert page.wait("error", 2)[1]["text"].startswith("policy: expected one of walk, aim, broken")


@pytest.mark.filterwarnings("ignore:message. ZeroDivisionError")
def test_a_character_that_breaks_stops_no_other_and_can_begin_anew(session):
    page, other = Listener(session, 1), Listener(session, 2)
    page.say("begin")
    page.wait("frame", AHEAD)
    page.say("push")
    page.say("shown", number=6)
    assert "ZeroDivisionError" in page.wait("error", 1)[0]["text"]
    other.say("begin")
    assert len(other.wait("frame", AHEAD)) == AHEAD
    page.say("restart")
    assert len(page.wait("frame", 2 * AHEAD)) == 2 * AHEAD


def test_pages_come_and_go_over_sockets_and_bad_messages_harm_nobody(session):
    scene = {"name": "scene"}
    with running(lambda log: (session, scene), app=SteerApp) as server:
        server.wait(2)
        with socket(server) as page:
            assert json.loads(page.recv(timeout=10)) == {"type": "ready", "scene": scene}
            for message in ("", b"\xff", "[1]", '{"type": "order", "goal": "aiming", "order": 3}'):
                page.send(message)
                assert json.loads(page.recv(timeout=10))["type"] == "error"
            page.send('{"type": "begin"}')
            assert json.loads(_head(page.recv(timeout=10)))["number"] == 1
            with socket(server), socket(server), socket(server):
                with socket(server) as fifth, pytest.raises(ConnectionClosed) as caught:
                    fifth.recv(timeout=10)
                assert caught.value.rcvd.reason == "at most 4 pages at once"
        deadline = time.monotonic() + 10
        while session._pages and time.monotonic() < deadline:
            time.sleep(0.01)
        assert not session._pages  # their characters are gone
        with socket(server) as again:
            assert json.loads(again.recv(timeout=10))["type"] == "ready"


def test_too_many_requests_of_a_page_are_refused(session, monkeypatch):
    monkeypatch.setattr(session, "_next", types.MethodType(lambda self: None, session))
    session.stop()
    page = Listener(session, 1)
    for _ in range(100):
        page.say("restart")
    with pytest.raises(MessageError, match="busy with earlier requests"):
        page.say("restart")
