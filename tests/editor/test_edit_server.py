"""The server over real sockets, with a session that answers at once: pages, and hostile callers."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import re
import struct
import threading
import time

import pytest
from edit_samples import make_curve
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from getup_jax import cli
from getup_jax.editor import messages, server
from getup_jax.editor.messages import pack
from getup_jax.editor.server import App
from getup_jax.editor.site import PAGE, Site

CURVE = make_curve().plain()
TOKEN = "abcdefghijkl"


class Quick:
    """A session that answers every simulation with one message."""

    def __init__(self, simulator) -> None:
        self.simulator, self.forgotten = simulator, []

    def submit(self, page, request, send):
        send(json.dumps({"type": "result", "number": request.number, "page": page}))

    def forget(self, page):
        self.forgotten.append(page)

    def stop(self):
        pass


class Running:
    """A server in a thread of its own."""

    def __init__(self, build, token=None, host="127.0.0.1"):
        self.said: list[str] = []
        self.error: BaseException | None = None
        self._app = App(build, Site.of(token))
        self._loop = asyncio.new_event_loop()
        self._task = self._loop.create_task(self._app.run(host, 0, self.said.append))
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        try:
            self._loop.run_until_complete(self._task)
        except BaseException as error:
            self.error = error

    def wait(self, lines: int = 2):
        deadline = time.monotonic() + 30
        while len(self.said) < lines and self._thread.is_alive() and time.monotonic() < deadline:
            time.sleep(0.01)
        return self

    @property
    def port(self) -> int:
        return int(re.search(r":(\d+)/", self.said[0])[1])

    def stop(self):
        self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(30)


@contextlib.contextmanager
def running(build, **options):
    server = Running(build, **options)
    try:
        yield server.wait(1)
    finally:
        server.stop()


@pytest.fixture(scope="module")
def site(simulator):
    session = Quick(simulator)
    with running(lambda log: (session, {"name": "scene"})) as server:
        yield server.wait(2)


def socket(server: Running, path: str = "/socket", **options):
    return connect(f"ws://127.0.0.1:{server.port}{path}", max_size=None, **options)


def get(server: Running, path: str, **headers: str) -> tuple[int, bytes, dict]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    response = connection.getresponse()
    return response.status, response.read(), dict(response.headers)


def ask(server: Running, message: str | bytes):
    """The answer to one message; the server must still be there for the next caller."""
    with socket(server) as page:
        assert json.loads(page.recv(timeout=10))["type"] == "ready"
        page.send(message)
        return page.recv(timeout=10)


def reason(server: Running, message: str | bytes) -> str:
    answer = json.loads(ask(server, message))
    assert answer["type"] == "error"
    return answer["text"]


def test_every_file_of_the_page_is_served_with_its_type(site):
    status, body, headers = get(site, "/")
    assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert body == (PAGE / "index.html").read_bytes()
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    for name in re.findall(rb'(?:src|href)="([^"]+)"', body):
        assert get(site, f"/{name.decode()}")[0] == 200
    modules = {path.name: path.read_text() for path in PAGE.glob("*.js")}
    for text in modules.values():
        for name in re.findall(r'from "\./([^"]+)"', text):
            status, _, headers = get(site, f"/{name}")
            assert (status, headers["Content-Type"]) == (200, "text/javascript; charset=utf-8")
        assert not re.findall(r'"https?://(?!www\.w3\.org)', text), "a download at run time"


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
    ],
)
def test_a_message_that_makes_no_sense_is_answered_with_a_reason(site, message, text):
    assert text in reason(site, message)


def request(**values) -> str:
    return json.dumps({"type": "simulate", "number": 5, "curve": CURVE, **values})


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
        ({"type": "export", "format": "exe"}, "format: expected one of bvh, npz, csv, mp4"),
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
    monkeypatch.setattr(server.checkpoint, "load_policy", lambda path: None)
    assert cli.edit_main(["--port", str(site.port)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"EditorError: port {site.port}: in use on 127.0.0.1; give another")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--port", "70000"], "expected a port from 0 to 65535"),
        (["--port", "http"], "expected a port"),
        (["--host", "0.0.0.0"], "other machines could reach it; give a --token as well"),
        (["--token", "short"], "expected at least 12 letters and digits"),
        (["--token", "a b c d e f g h"], "expected at least 12 letters and digits"),
    ],
)
def test_bad_arguments_are_refused(arguments, text, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.edit_main(arguments)
    assert caught.value.code == 2
    assert text in capsys.readouterr().err
