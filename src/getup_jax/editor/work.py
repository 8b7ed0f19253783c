"""Answers that take a while, in threads: how many at once, and what a page that leaves abandons."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable
from typing import TypeVar

from getup_jax.editor.answers import answer
from getup_jax.editor.messages import MessageError, Request
from getup_jax.editor.outbox import Outbox
from getup_jax.editor.session import Session, error_message
from getup_jax.motion.retarget.subprocess_job import Stop

SLOW = 2  # imports and exports at once, of all pages together
_QUICK = 8  # requests of one page that are not answered yet
_STEP = 0.01  # of a file, between two words on how much is done
_SLOW_TYPES = ("import", "export")

T = TypeVar("T")


class Work:
    """The answers in the making, of all pages; used in the event loop's thread only."""

    def __init__(self) -> None:
        self._slots = asyncio.Semaphore(SLOW)
        self._tasks: dict[asyncio.Task[None], tuple[Outbox, bool, int]] = {}

    def start(self, request: Request, session: Session, box: Outbox) -> None:
        """Answer a request; MessageError where the page waits for too much already."""
        slow = request.type in _SLOW_TYPES
        own = [is_slow for page, is_slow, _ in self._tasks.values() if page is box]
        if len(own) >= _QUICK or (slow and sum(own) >= SLOW):
            raise MessageError("busy with earlier files; try again in a moment")
        task = asyncio.create_task(self._answer(request, session, box, slow))
        self._tasks[task] = box, slow, request.number
        task.add_done_callback(self._tasks.pop)

    def abandon(self, box: Outbox) -> None:
        """The page is gone: whatever is made for it ends."""
        for task in [task for task, (page, *_) in self._tasks.items() if page is box]:
            task.cancel()

    def cancel(self, request: Request, box: Outbox) -> None:
        """End what the page asked for under a number; it is told so, where that was under way."""
        for task, (page, _, number) in list(self._tasks.items()):
            if page is box and number == request.of:
                task.cancel()
                box.put(error_message(Request("export", number), MessageError("cancelled")))

    async def _answer(self, request: Request, session: Session, box: Outbox, slow: bool) -> None:
        # what is quick waits for nothing that is slow
        slot = self._slots if slow else contextlib.nullcontext()
        try:
            async with slot:
                said = _Progress(request, box)
                box.put(await _in_thread(lambda stop: answer(request, session, stop, said)))
        except Exception as error:  # told to the page, the server lives
            box.put(error_message(request, error))


class _Progress:
    """Tells a page how much of its file is made, in whole hundredths; from any thread."""

    def __init__(self, request: Request, box: Outbox) -> None:
        self._number, self._box, self._last = request.number, box, 0.0

    def __call__(self, share: float) -> None:
        if share < self._last + _STEP:
            return
        self._last = share
        message = {"type": "progress", "number": self._number, "share": round(share, 3)}
        self._box.put_from_thread(json.dumps(message))


async def _in_thread(work: Callable[[Stop], T]) -> T:
    """The result of the work; a task that is cancelled stops it, and ends when it has ended."""
    stop = Stop()
    thread = asyncio.ensure_future(asyncio.to_thread(work, stop))
    try:
        return await asyncio.shield(thread)
    except asyncio.CancelledError:
        stop.set()
        await asyncio.wait({thread})  # until then, its slot is taken
        if not thread.cancelled():
            thread.exception()  # that it was abandoned is no news
        raise
