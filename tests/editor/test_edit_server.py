"""The server over real sockets: files, messages, pages that come and go, its start."""

from __future__ import annotations

import json
import re
import struct
import threading
import time
import types

import pytest
from edit_running import CURVE, Quick, Running, ask, get, request, running, socket

from getup_jax.cli import main
from getup_jax.editor import messages, server
from getup_jax.editor.site import PAGE


def test_every_file_of_the_page_is_served_with_its_type(site):
    status, body, headers = get(site, "/")
    assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert b"<title>getup-edit: draw a get-up</title>" in body
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    for name in re.findall(rb'(?:src|href)="([^"]+)"', body):
        assert get(site, f"/{name.decode()}")[0] == 200
    modules = {path.name: path.read_text() for path in PAGE.glob("*.js")}
    for text in modules.values():
        for name in re.findall(r'from "\./([^"]+)"', text):
            status, _, headers = get(site, f"/{name}")
            assert (status, headers["Content-Type"]) == (200, "text/javascript; charset=utf-8")
        assert not re.findall(r'"https?://(?!www\.w3\.org)', text), "a download at run time"


def test_save_and_load_are_inverse(site):
    saved = ask(site, request(type="save"))
    assert isinstance(saved, bytes)
    (length,) = struct.unpack_from("<I", saved)
    head, text = json.loads(saved[4 : 4 + length]), saved[4 + length :].decode()
    assert head == {"type": "file", "number": 5, "name": "line.yaml"}
    load = {"type": "load", "number": 6, "name": "line.yaml", "text": text}
    answer = json.loads(ask(site, json.dumps(load)))
    assert (answer["type"], answer["curves"]) == ("curves", [CURVE])


def test_two_pages_get_their_own_answers_and_leave(site):
    with socket(site) as first, socket(site) as second:
        for page in (first, second):
            page.recv(timeout=10)
            page.send(request())
        pages = {json.loads(page.recv(timeout=10))["page"] for page in (first, second)}
        assert len(pages) == 2
    deadline = time.monotonic() + 10
    while time.monotonic() < deadline and not pages <= set(site._app._session.forgotten):
        time.sleep(0.01)
    assert pages <= set(site._app._session.forgotten)


def test_pages_hear_of_the_start_and_ask_in_vain_before_it(simulator):
    go = threading.Event()

    def build(log):
        log("compiling ...")
        go.wait(30)
        return Quick(simulator), {"name": "scene"}

    with running(build) as server, socket(server) as page:
        texts = [json.loads(page.recv(timeout=10))["text"]]
        while texts[-1] != "compiling ...":
            texts.append(json.loads(page.recv(timeout=10))["text"])
        page.send(request())
        assert "not ready yet" in json.loads(page.recv(timeout=10))["text"]
        go.set()
        ready = json.loads(page.recv(timeout=10))
        assert ready == {"type": "ready", "scene": {"name": "scene"}}


def test_what_goes_wrong_at_the_start_ends_the_server_with_its_reason():
    def build(log):
        raise messages.MessageError("no motions")

    server = Running(build)
    server._thread.join(30)
    assert isinstance(server.error, messages.MessageError)


def test_a_port_in_use_is_said(site, capsys, monkeypatch):
    loaded = types.SimpleNamespace(config=types.SimpleNamespace(composite_motion=False))
    monkeypatch.setattr(server.checkpoint, "load_policy", lambda path: loaded)
    assert main.edit_main(["--port", str(site.port)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"EditorError: port {site.port}: in use on 127.0.0.1; give another")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--port", "70000"], "expected a port from 0 to 65535"),
        (["--port", "http"], "expected a port"),
        (["--host", "0.0.0.0"], "other machines could reach it; give a --token as well"),
        (["--token", "short"], "expected at least 12 letters and digits"),
        (["--ckpt", "walk", "--ckpt=walk_aim"], "expected one policy, the first; name the others"),
        (["--with"], "expected at least one argument"),
        (["--token", "a b c d e f g h"], "expected at least 12 letters and digits"),
    ],
)
def test_bad_arguments_are_refused(arguments, text, capsys):
    with pytest.raises(SystemExit) as caught:
        main.edit_main(arguments)
    assert caught.value.code == 2
    assert text in capsys.readouterr().err


def test_options_of_steering_are_refused_where_curves_are_drawn(capsys):
    for option in ("--with", "--getup"):
        assert main.edit_main(["--ckpt", "flat", option, "walk", "--port", "0"]) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"EditorError: {option}: is for policies of composite motion")
        assert said.count("\n") == 1
