"""What a page is still to be sent."""

from __future__ import annotations

import asyncio
import contextlib

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

MAX_UNSENT = 4000  # messages that wait for a page that does not read them


class Outbox:
    """Messages of one page in their order; a page that reads too slowly is closed."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._queue: asyncio.Queue[str | bytes] = asyncio.Queue()

    def put(self, message: str | bytes) -> None:
        """Send it after what waits already; from the loop's own thread."""
        self._queue.put_nowait(message)

    def put_from_thread(self, message: str | bytes) -> None:
        """The same from any thread; nothing happens where the loop has ended."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self.put, message)

    async def drain(self, connection: ServerConnection) -> None:
        """Send for as long as the page is there."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                message = await self._queue.get()
                if self._queue.qsize() > MAX_UNSENT:
                    await connection.close(1013, "the page reads too slowly")
                    return
                await connection.send(message)
