"""The server of `getup-edit`: the page's files and one WebSocket a page, in one event loop.

The loop only passes messages on. Simulations run in the session's thread, slow work (imports,
exports) in threads of its own.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import errno
import itertools
import json
import signal
import sys
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from getup_jax.editor import messages
from getup_jax.editor.compiled import keep_compiled
from getup_jax.editor.outbox import Outbox
from getup_jax.editor.scene import describe
from getup_jax.editor.session import Session, error_message
from getup_jax.editor.simulate import Simulator
from getup_jax.editor.site import Site
from getup_jax.editor.starts import reference_curve
from getup_jax.editor.work import Work
from getup_jax.runtime import checkpoint
from getup_jax.runtime.checkpoint import LoadedPolicy

_MAX_BYTES = messages.MAX_FILE_BYTES + messages.MAX_TEXT_BYTES

Build = Callable[[Callable[[str], None]], tuple[Any, dict[str, Any]]]


class EditorError(ValueError):
    """The editor cannot be served; the text says why and what to do."""


def edit_command(args: argparse.Namespace) -> int:
    """The command line of `getup-edit`; returns the exit code."""
    # a film's ffmpeg is a fork and an exec in one, which is safe; films in several threads take
    # each other's filter away, so that this one is for good
    warnings.filterwarnings("ignore", message="os.fork", category=RuntimeWarning)
    keep_compiled()
    loaded = checkpoint.load_policy(args.ckpt)
    app = _steering(loaded, args) if loaded.config.composite_motion else _editing(loaded, args)
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(app.run(args.host, args.port))
    return 0


def _editing(loaded: LoadedPolicy, args: argparse.Namespace) -> App:
    """The page that draws the curves of a policy that gets up."""
    for option, given in (("--with", args.others), ("--getup", args.getup)):
        if given:
            raise EditorError(
                f"{option}: is for policies of composite motion, which are steered; {args.ckpt} "
                "gets up, and its curves are drawn; leave it out, or steer, as getup-edit --ckpt "
                "walk does"
            )
    return App(lambda log: build_session(loaded, log), Site.of(args.token))


def _steering(loaded: LoadedPolicy, args: argparse.Namespace) -> App:
    """The page in which policies of composite motion are steered."""
    # imported here, since pages of get-up policies do without
    from getup_jax.editor.steer.app import steering

    return steering(args.ckpt, loaded, args.others, args.getup, args.token)


def build_session(
    loaded: LoadedPolicy, log: Callable[[str], None]
) -> tuple[Session, dict[str, Any]]:
    """The session of a policy, compiled, and what pages must know of it."""
    simulator = Simulator.build(loaded, log)
    log("compiling the episode ...")
    first = reference_curve(simulator.task.getups[0])
    with ThreadPoolExecutor(max_workers=1) as thread:
        compiled = thread.submit(next, simulator.run(first))  # its first frames need all programs
        scene = describe(simulator, loaded)
        compiled.result()
    return Session(simulator), scene


class App:
    """All pages and the session that they share."""

    most_pages = 16

    def __init__(self, build: Build, site: Site) -> None:
        self._build, self._site = build, site
        self._pages = itertools.count()
        self._boxes: dict[int, Outbox] = {}
        self._session: Any = None  # once it is built; see `Build`
        self._hello = _status("starting", "loading")
        self._work = Work()

    async def run(self, host: str, port: int, ready: Callable[[str], None] = print) -> None:
        """Serve until the task is cancelled or SIGTERM comes."""
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        with contextlib.suppress(NotImplementedError, RuntimeError, ValueError):
            loop.add_signal_handler(signal.SIGTERM, stop.set)
        async with await self._listen(host, port) as server:
            ready(self._address(server, host))
            building = asyncio.create_task(self._start(loop))
            stopping = asyncio.create_task(stop.wait())
            try:
                await asyncio.wait({building, stopping}, return_when=asyncio.FIRST_COMPLETED)
                if building.done():
                    building.result()  # raises what went wrong
                    ready("ready; Ctrl-C ends it")
                await stop.wait()
            finally:
                stopping.cancel()
                if self._session is not None:
                    self._session.stop()

    async def _listen(self, host: str, port: int) -> Server:
        try:
            return await serve(
                self._page,
                host,
                port,
                process_request=lambda _, request: self._site.answer(request),
                max_size=_MAX_BYTES,
                compression=None,
                server_header=None,
                open_timeout=10,
            )
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise EditorError(
                    f"port {port}: in use on {host}; give another one with --port, or 0 for any"
                ) from None
            raise EditorError(
                f"cannot listen on {host}, port {port}: {error.strerror or error}; "
                "choose another --host or --port"
            ) from None

    def _address(self, server: Server, host: str) -> str:
        port = next(iter(server.sockets)).getsockname()[1]
        name = f"[{host}]" if ":" in host else host
        query = f"/?token={self._site.token}" if self._site.token else "/"
        return f"getup-edit: http://{name}:{port}{query}"

    async def _start(self, loop: asyncio.AbstractEventLoop) -> None:
        def log(text: str) -> None:
            print(text, file=sys.stderr, flush=True)
            loop.call_soon_threadsafe(self._announce, _status("starting", text))

        try:
            self._session, scene = await asyncio.to_thread(self._build, log)
        except Exception as error:
            self._announce(_status("failed", f"{type(error).__name__}: {error}"))
            await asyncio.sleep(0.2)  # so that pages hear of it
            raise
        self._announce(json.dumps({"type": "ready", "scene": scene}))

    def _announce(self, message: str) -> None:
        self._hello = message
        for box in self._boxes.values():
            box.put(message)

    async def _page(self, connection: ServerConnection) -> None:
        """One page from its first message to its last."""
        if len(self._boxes) >= self.most_pages:
            await connection.close(1013, f"at most {self.most_pages} pages at once")
            return
        page, box = next(self._pages), Outbox(connection)
        self._boxes[page] = box
        box.put(self._hello)
        sender = asyncio.create_task(box.drain())
        try:
            async for message in connection:
                self._receive(page, message, box)
        except ConnectionClosed:
            pass
        finally:
            del self._boxes[page]
            if self._session is not None:
                self._session.forget(page)
            self._work.abandon(box)
            sender.cancel()

    def _receive(self, page: int, message: str | bytes, box: Outbox) -> None:
        """Pass a request on; what is wrong with it is said, and nothing else happens."""
        request = None
        try:
            request = self._read(message)
            if self._session is None:
                raise messages.MessageError("not ready yet; ask again when the page says ready")
            self._do(page, request, box)
        except Exception as error:  # told to the page, whose connection lives
            box.put(error_message(request, error))

    def _read(self, message: str | bytes) -> Any:
        """The request in a message."""
        return messages.read(message)

    def _do(self, page: int, request: Any, box: Outbox) -> None:
        if request.type == "simulate":
            self._session.submit(page, request, box.put_from_thread)
        elif request.type == "cancel":
            self._work.cancel(request, box)
        else:
            self._work.start(request, self._session, box)


def _status(state: str, text: str) -> str:
    return json.dumps({"type": "status", "state": state, "text": text})
