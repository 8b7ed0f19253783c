"""What a page is still to be sent."""

from __future__ import annotations

import asyncio
import contextlib

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

MAX_UNSENT = 4000  # messages that wait for a page that does not read them
TOO_SLOW = "the page reads too slowly"


class Outbox:
    """Messages of one page in their order; a page that reads too slowly is closed."""

    def __init__(self, connection: ServerConnection) -> None:
        self._connection = connection
        self._loop = asyncio.get_running_loop()
        self._queue: asyncio.Queue[str | bytes] = asyncio.Queue()
        self._closing: asyncio.Task[None] | None = None

    def put(self, message: str | bytes) -> None:
        """Send it after what waits already; from the loop's own thread."""
        if self._closing is not None:
            return
        if self._queue.qsize() < MAX_UNSENT:
            self._queue.put_nowait(message)
        else:
            self._closing = self._loop.create_task(self._connection.close(1013, TOO_SLOW))

    def put_from_thread(self, message: str | bytes) -> None:
        """The same from any thread; nothing happens where the loop has ended."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self.put, message)

    async def drain(self) -> None:
        """Send for as long as the page is there."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                await self._connection.send(await self._queue.get())
