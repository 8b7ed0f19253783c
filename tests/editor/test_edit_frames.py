"""Frames that break the rules of a WebSocket or of our messages, and the connection after them."""

from __future__ import annotations

import json
import warnings

import pytest
from edit_running import CURVE, Quick, request, running, socket
from websockets.exceptions import ConnectionClosed

DEEP = "[" * 900 + "]" * 900


@pytest.fixture(scope="module")
def site():
    with running(lambda log: (Quick(None), {})) as server:
        yield server.wait(2)


@pytest.fixture(autouse=True)
def quiet(capfd):
    """Nothing that a page sends may show on the terminal of the server."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield
    captured = capfd.readouterr()
    assert "Traceback" not in captured.out + captured.err


@pytest.mark.parametrize(
    "message",
    [
        request(curve={**CURVE, "height": [10**400] * 9}),
        request(curve={**CURVE, "durations": [10**4000]}),
        request(curve={**CURVE, "height": json.loads(DEEP)}),
        request(curve=json.loads(DEEP)),
        request(curve={"\ud800": 1}),
        request(curve={**CURVE, "name": "\ud800"}),
        request(slot=float("inf")),
        request(number=[]),
        request(type="\ud800"),
        request(type=json.loads(DEEP)),
        request(type="load", name="a.yaml", text="\ud800"),
        request(type="load", name="a.yaml", text="!!int ''"),
        request(type="load", name="a.yaml", text="durations: [" + "1" * 5000 + "]"),
        request(type="load", name="a.yaml", text="a: {" * 9000),
        request(type="load", name="\ud800.yaml", text=""),
        '{"type": "save", "number": ' + "9" * 5000 + "}",
        "[" * 100_000,
        "\0",
    ],
)
def test_the_connection_lives_on(site, message):
    with socket(site) as page:
        page.recv(timeout=10)
        page.send(message)
        answer = json.loads(page.recv(timeout=30))
        assert answer["type"] == "error"
        assert "Error" not in answer["text"]
        page.send(request(type="save"))
        assert isinstance(page.recv(timeout=10), bytes)


@pytest.mark.parametrize("text", [b"\xed\xa0\x80", b'{"type": "\xed\xa0\x80"}', b"\xff", b"\xc3"])
def test_text_that_is_no_utf8_ends_its_connection_alone(site, text):
    with socket(site) as page:
        page.recv(timeout=10)
        page.send(text, text=True)
        with pytest.raises(ConnectionClosed) as caught:
            page.recv(timeout=10)
        assert caught.value.rcvd.code == 1007
    with socket(site) as page:
        assert json.loads(page.recv(timeout=10))["type"] == "ready"


def test_parts_of_a_message_are_one_message(site):
    text = request(type="save")
    with socket(site) as page:
        page.recv(timeout=10)
        page.send([text[:7], "", text[7:]])
        assert isinstance(page.recv(timeout=10), bytes)
