"""Ctrl-C, SIGTERM and a closed terminal as a request that a loop reads between two iterations.

Python runs its own signal handlers only between two byte codes of the main thread, which
is far too late while that thread waits for a long XLA program. So a thread of ours reads
the signals from a wake-up socket: the user has an answer at once.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import socket
import threading
import time
from collections.abc import Callable

_HANGUP = getattr(signal, "SIGHUP", None)  # Windows has none
_SIGNALS = tuple(s for s in (signal.SIGINT, signal.SIGTERM, _HANGUP) if s is not None)
# `timeout` and process managers send a signal to the process and to its group, which is one
# request; nobody's second thought comes as soon
_SAME_S = 1.0
_SHOW_CURSOR = b"\x1b[?25h"


class StopRequest:
    """A context manager; `signal` is the number of the signal that came, or None.

    Outside of `armed` there is nothing to save, and a signal ends the process at once; so
    does a second Ctrl-C in it. The same signal again within a second is the same request. What
    `nohup` has switched off stays off. Does nothing where it is entered in another than the
    main thread, since only that one may handle signals.
    """

    def __init__(self, log: Callable[[str], None]) -> None:
        self.signal: int | None = None
        self._log = log
        self._armed = False
        self._came: dict[int, float] = {}  # signal -> when it was last taken for a request
        self._undo = contextlib.ExitStack()

    @contextlib.contextmanager
    def armed(self):
        """While this is open, a signal is a request."""
        self._armed = True
        try:
            yield
        finally:
            self._armed = False

    def __enter__(self) -> StopRequest:
        if threading.current_thread() is threading.main_thread():
            self._listen()
        return self

    def __exit__(self, *_: object) -> None:
        self._undo.close()

    def _listen(self) -> None:
        reader, writer = socket.socketpair()
        writer.setblocking(False)
        thread = threading.Thread(target=self._receive, args=(reader,), daemon=True)
        thread.start()
        # Undone from the last to the first: the closed writer ends the thread.
        self._undo.callback(thread.join)
        self._undo.callback(writer.close)
        for number in _SIGNALS:
            if number == _HANGUP and signal.getsignal(number) == signal.SIG_IGN:
                continue
            # With a handler in Python, the signal number is written to the wake-up socket.
            self._undo.callback(signal.signal, number, signal.signal(number, lambda *_: None))
        before = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
        self._undo.callback(signal.set_wakeup_fd, before)

    def _receive(self, reader: socket.socket) -> None:
        with reader:
            while numbers := reader.recv(1):
                if numbers[0] in _SIGNALS:
                    self._handle(numbers[0])

    def _handle(self, number: int) -> None:
        now, again = time.monotonic(), self.signal is not None
        if now - self._came.get(number, -math.inf) < _SAME_S:
            return
        self._came[number] = now
        if not self._armed or (again and number == signal.SIGINT):
            self._exit(number)
        if not again:
            self.signal = number
            self._log("stopping after this iteration, then saving; Ctrl-C again exits at once")

    def _exit(self, number: int) -> None:
        with contextlib.suppress(OSError):
            if os.isatty(1):
                os.write(1, _SHOW_CURSOR)  # the progress bar had hidden it
            os.write(2, b"\nstopped at once; nothing was saved\n")
        os._exit(128 + number)
