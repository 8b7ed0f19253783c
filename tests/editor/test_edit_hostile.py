"""Callers that the server must refuse, or bear without harm to others."""

from __future__ import annotations

import contextlib
import json
import time

import pytest
from edit_running import CURVE, TOKEN, Quick, ask, get, reason, request, running, socket
from websockets.exceptions import ConnectionClosed, InvalidStatus

from getup_jax.editor import messages, outbox, server
from getup_jax.editor.messages import pack


@pytest.mark.parametrize(
    "path",
    [
        *("/../server.py", "/..%2fserver.py", "/%2e%2e/server.py", "//etc/passwd"),
        *("/vendor/../main.js", "/index.html/..", "/vendor", "/main.js%00"),
        *("/README.md", "/vendor/README.md"),
    ],
)
def test_only_names_of_the_table_are_served(site, path):
    assert get(site, path)[0] == 404


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", ""])
def test_another_host_name_is_refused(site, host):
    assert get(site, "/", Host=host)[0] in (400, 403)


def test_another_origin_is_refused(site):
    for origin in ("http://evil.example", "null", "https://127.0.0.1:1"):
        with pytest.raises(InvalidStatus) as caught, socket(site, origin=origin):
            pass
        assert caught.value.response.status_code == 403
    with socket(site, origin=f"http://127.0.0.1:{site.port}") as page:
        assert json.loads(page.recv(timeout=10))["type"] == "ready"
    assert get(site, "/", Host=f"localhost:{site.port}")[0] == 200


def test_a_token_is_asked_for_at_the_page_and_at_the_socket(simulator):
    with running(lambda log: (Quick(simulator), {}), token=TOKEN) as server:
        server.wait(2)
        assert server.said[0].endswith(f"/?token={TOKEN}")
        assert get(server, "/")[0] == 403
        assert get(server, "/?token=abcdefghijkm")[0] == 403
        assert get(server, f"/?token={TOKEN}", Host="machine.example:1")[0] == 200
        with pytest.raises(InvalidStatus), socket(server):
            pass
        with socket(server, f"/socket?token={TOKEN}") as page:
            assert json.loads(page.recv(timeout=10))["type"] == "ready"


HUGE = "x" * (messages.MAX_TEXT_BYTES + 1)


@pytest.mark.parametrize(
    ("message", "text"),
    [
        ("", "expected JSON"),
        ("nonsense", "expected JSON"),
        ("[" * 100_000, "expected JSON"),
        ("[1, 2]", "expected a JSON object"),
        ("NaN", "expected a JSON object"),
        (HUGE, "expected at most 128000 bytes"),
        ('{"type": "shutdown"}', "unknown type 'shutdown'"),
        ('{"type": ["simulate"]}', "unknown type"),
        ('{"type": "import", "number": 1}', "unknown type 'import'"),
        ('{"type": "simulate"}', "number: expected a whole number"),
        ('{"type": "simulate", "number": 1.5}', "number: expected a whole number"),
        ('{"type": "simulate", "number": 1}', "curve: expected the keys"),
        (b"", "expected a header and a file"),
        (b"\xff\xff\xff\xff{}", "expected a header and a file"),
        (b"\x02\x00\x00\x00\xff\xfe", "expected a header in UTF-8"),
        (pack({"type": "simulate", "number": 1}, b""), "unknown type 'simulate'"),
        (pack({"type": "import", "number": 1, "name": "../a.bvh"}, b"x"), "without its folder"),
        (pack({"type": "import", "number": 1, "name": "a.exe"}, b"x"), "expected a file that ends"),
        (pack({"type": "import", "number": 1, "name": "a.npz"}, b"PK\x03\x04"), "not a clip"),
        (pack({"type": "import", "number": 1, "name": "a.npz"}, b""), "not a clip"),
    ],
)
def test_a_message_that_makes_no_sense_is_answered_with_a_reason(site, message, text):
    assert text in reason(site, message)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"slot": 4}, "slot: expected a whole number from 0 to 3"),
        ({"region": -1}, "region: expected"),
        ({"place": True}, "place: expected"),
        ({"curve": {**CURVE, "durations": [1e9]}}, "durations: expected numbers from 0.5 to 20"),
        ({"curve": {**CURVE, "height": [1e300] * 9}}, "height: expected numbers"),
        ({"curve": {**CURVE, "height": [None] * 9}}, "height: expected numbers"),
        ({"curve": {**CURVE, "height": [0] * 10_000}}, "height: expected numbers"),
        (
            {"type": "export", "format": "exe"},
            "format: expected one of glb, usd, bvh, npz, csv, mp4",
        ),
        ({"type": "load", "name": "a.yaml", "text": "x"}, "a.yaml: expected the keys"),
        ({"type": "load", "name": "a/b.yaml"}, "name: expected the name of a file"),
    ],
)
def test_values_out_of_range_are_refused_with_a_reason(site, values, text):
    assert text in reason(site, request(**values))


def test_an_oversized_frame_ends_the_connection_and_not_the_server(site):
    with socket(site) as page:
        page.recv(timeout=10)
        with contextlib.suppress(ConnectionClosed):
            page.send(b"\x00" * (server._MAX_BYTES + 1))
        with pytest.raises(ConnectionClosed):
            page.recv(timeout=30)
    assert json.loads(ask(site, request()))["type"] == "result"


def wait_until_empty(site) -> None:
    deadline = time.monotonic() + 10
    while site._app._boxes and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not site._app._boxes


def test_a_page_too_many_is_sent_away_until_another_leaves(site, monkeypatch):
    wait_until_empty(site)
    monkeypatch.setattr(server.App, "most_pages", 1)
    with socket(site) as first:
        first.recv(timeout=10)
        with socket(site) as second, pytest.raises(ConnectionClosed) as caught:
            second.recv(timeout=10)
        assert (caught.value.rcvd.code, caught.value.rcvd.reason) == (
            1013,
            "at most 1 pages at once",
        )
    wait_until_empty(site)
    assert json.loads(ask(site, request()))["type"] == "result"


def read_all(page) -> None:
    while True:
        page.recv(timeout=10)


def test_a_page_that_does_not_read_is_closed_and_no_other_waits_for_it(site, monkeypatch):
    monkeypatch.setattr(outbox, "MAX_UNSENT", 20)
    sent = site._app._session.submit

    def much(page, request, send):
        if request.slot == 3:
            for _ in range(400):
                send("x" * 100_000)
        sent(page, request, send)

    monkeypatch.setattr(site._app._session, "submit", much)
    with socket(site) as slow:
        slow.recv(timeout=10)
        slow.send(request(slot=3))
        assert json.loads(ask(site, request()))["type"] == "result"
        with pytest.raises(ConnectionClosed) as caught:
            read_all(slow)  # what was sent before the server gave up
    assert caught.value.rcvd.reason == outbox.TOO_SLOW
