"""The worker behind the pages: it simulates one curve after the other, and the newest wins."""

from __future__ import annotations

import collections
import dataclasses
import json
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any, Protocol

from getup_jax.core.cpus import cpus
from getup_jax.editor import messages
from getup_jax.editor.messages import Request
from getup_jax.editor.scene import ground
from getup_jax.editor.simulate import Frames, Motion, Simulator

_KEPT = 16  # motions kept for exports
_PAGE_DRAWS_S = 0.05  # what a page takes to show the first frames
Send = Callable[[str | bytes], None]  # may be called from any thread


@dataclasses.dataclass(frozen=True, eq=False)
class Job:
    """A simulation that a page waits for."""

    key: tuple[int, int]  # page and variant
    request: Request
    send: Send


class Session:
    """One thread that simulates; pages submit and may leave at any time.

    A job replaces the one of the same page and variant, also one that is being simulated: that
    stops after the chunk at hand. Others wait in the order in which they came. Motions that are
    wanted for something else are simulated in between, a chunk at a time.
    """

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator
        self._wake = threading.Condition()
        self._waiting: collections.OrderedDict[tuple[int, int], Job] = collections.OrderedDict()
        self._current: Job | None = None
        self._motions: collections.OrderedDict[str, Motion] = collections.OrderedDict()
        self._compute = threading.Lock()  # the one who simulates
        self._stopped = False
        self._thread = threading.Thread(target=self._work, name="simulate", daemon=True)
        self._thread.start()

    def submit(self, page: int, request: Request, send: Send) -> None:
        """Simulate as soon as possible; frames and then the result go to `send`."""
        with self._wake:
            key = (page, request.slot)
            self._waiting[key] = Job(key, request, send)
            if self._current is not None and self._current.key == key:
                self._current = None
            self._wake.notify_all()

    def forget(self, page: int) -> None:
        """The page is gone."""
        with self._wake:
            for key in [key for key in self._waiting if key[0] == page]:
                del self._waiting[key]
            if self._current is not None and self._current.key[0] == page:
                self._current = None
            self._wake.notify_all()

    def motion(self, request: Request, check: Callable[[], None] = lambda: None) -> Motion:
        """The motion of a request: the one that was shown last for it, or simulated now.

        check: called between two chunks; what it raises ends the simulation.
        """
        key = _key(request)
        with self._wake:
            if key in self._motions:
                return self._motions[key]
        assert request.curve is not None
        for part in self._between(self.simulator.run(request.curve, request.place)):
            check()
            if isinstance(part, Motion):
                self._keep(key, part)
                return part
        raise AssertionError("a run ends with its motion")

    def _between(self, parts: Iterator[Frames | Motion]) -> Iterator[Frames | Motion]:
        """The parts, each made when no page waits for frames."""
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._stopped or not (self._waiting or self._current))
            with self._compute:
                part = next(parts, None)
            if part is None:
                return
            yield part

    def stop(self) -> None:
        """End the thread after the chunk at hand."""
        with self._wake:
            self._stopped, self._current = True, None
            self._wake.notify_all()
        self._thread.join(timeout=10)

    def _work(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._waiting or self._stopped)
                if self._stopped:
                    return
                _, job = self._waiting.popitem(last=False)
                self._current = job
            try:
                with self._compute:
                    self._simulate(job)
            except Exception as error:  # a job that fails stops no other
                job.send(error_message(job.request, error))
            with self._wake:
                if self._current is job:
                    self._current = None
                self._wake.notify_all()

    def _simulate(self, job: Job) -> None:
        begin, curve = time.perf_counter(), job.request.curve
        assert curve is not None
        total = self.simulator.steps(curve)
        for part in self.simulator.run(curve, job.request.place):
            with self._wake:
                if self._current is not job:
                    return
            if isinstance(part, Frames):
                if part.first == 0:
                    self._send_ground(job, part)
                job.send(messages.frames_message(job.request, part, total))
                if part.first == 0 and cpus() == 1:  # which a browser shares
                    self._let_the_page_draw(job)
            else:
                self._keep(_key(job.request), part)
                seconds = time.perf_counter() - begin
                job.send(messages.result_message(job.request, part, seconds))

    def _let_the_page_draw(self, job: Job) -> None:
        """A pause in which a page on the same core shows the first frames; a newer job ends it."""
        with self._wake:
            self._wake.wait_for(lambda: self._current is not job, timeout=_PAGE_DRAWS_S)

    def _send_ground(self, job: Job, frames: Frames) -> None:
        """The ground around the start comes before the first frames; a plane needs no words."""
        around = ground(self.simulator, frames.links[0, 0, :2])
        if around is not None:
            header = {"type": "ground", "slot": job.request.slot, "number": job.request.number}
            job.send(json.dumps({**header, **around}))

    def _keep(self, key: str, motion: Motion) -> None:
        with self._wake:
            self._motions[key] = motion
            self._motions.move_to_end(key)
            while len(self._motions) > _KEPT:
                self._motions.popitem(last=False)


class Asked(Protocol):
    """A request, as far as an answer names it."""

    @property
    def type(self) -> str:
        """Its kind."""
        ...

    @property
    def number(self) -> int:
        """The page's own."""
        ...


def error_message(request: Asked | None, error: Exception) -> str:
    """What a page is told: one line. What is not meant for users is named, and said here."""
    text = str(error)
    if not type(error).__module__.startswith("getup_jax."):
        kind, name = request.type if request else "message", type(error).__name__
        warnings.warn(f"{kind}: {name}: {text}", stacklevel=2)
        text = f"the editor failed at this ({name}); its terminal says more"
    answer: dict[str, Any] = {"type": "error", "text": " ".join(text.split())[:2000]}
    if request is not None:
        answer |= {"number": request.number, "of": request.type}
    return json.dumps(answer)


def _key(request: Request) -> str:
    """What a motion depends on; names change none."""
    assert request.curve is not None
    named = dataclasses.replace(request.curve, name="", strategy="", ground=None)
    return json.dumps([named.plain(), dataclasses.astuple(request.place)])
