"""A server of the editor on a real port, with a session that answers at once, and callers of it."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import re
import threading
import time

from edit_samples import make_curve
from websockets.sync.client import connect

from getup_jax.editor.server import App
from getup_jax.editor.site import Site

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

    def __init__(self, build, token=None, host="127.0.0.1", app=App):
        self.said: list[str] = []
        self.error: BaseException | None = None
        self._app = app(build, Site.of(token))
        self._loop = asyncio.new_event_loop()
        self._task = self._loop.create_task(self._app.run(host, 0, self.said.append))
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        try:
            self._loop.run_until_complete(self._task)
        except BaseException as error:
            self.error = error
        finally:
            self._end()

    def _end(self):
        """Nothing of this server is left to the tests after it."""
        left = asyncio.all_tasks(self._loop)
        for task in left:
            task.cancel()
        if left:
            self._loop.run_until_complete(asyncio.wait(left))
        self._loop.run_until_complete(self._loop.shutdown_default_executor())
        self._loop.close()

    def wait(self, lines: int = 2):
        deadline = time.monotonic() + 30
        while len(self.said) < lines and self._thread.is_alive() and time.monotonic() < deadline:
            time.sleep(0.01)
        return self

    @property
    def port(self) -> int:
        return int(re.search(r":(\d+)/", self.said[0])[1])

    def stop(self):
        with contextlib.suppress(RuntimeError):  # where it has ended by itself
            self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(30)


@contextlib.contextmanager
def running(build, **options):
    server = Running(build, **options)
    try:
        yield server.wait(1)
    finally:
        server.stop()


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


def request(**values) -> str:
    return json.dumps({"type": "simulate", "number": 5, "curve": CURVE, **values})
