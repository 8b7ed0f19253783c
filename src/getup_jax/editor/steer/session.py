"""One thread that simulates for all pages, a character each, and never far ahead of any page."""

from __future__ import annotations

import collections
import dataclasses
import json
import math
import sys
import threading
from collections.abc import Callable

from getup_jax.editor.messages import MessageError
from getup_jax.editor.session import error_message
from getup_jax.editor.steer.character import Character
from getup_jax.editor.steer.messages import Request, frame_message
from getup_jax.editor.steer.policies import Policies

AHEAD = 6  # control steps that are simulated before they are shown; an order acts after so many
_MOST_WAITING = 100  # requests of a page
Send = Callable[[str | bytes], None]  # may be called from any thread


@dataclasses.dataclass(eq=False)
class _Page:
    """A page, its character, and how far that is ahead of what is shown."""

    send: Send
    requests: collections.deque[Request] = dataclasses.field(default_factory=collections.deque)
    character: Character | None = None
    made: int = 0  # frames that were sent
    shown: int = 0  # of them, on the screen

    @property
    def due(self) -> bool:
        """Whether there is something to do for it."""
        ahead = self.made - self.shown
        return bool(self.requests) or (self.character is not None and ahead < AHEAD)


class Session:
    """Pages submit and may leave at any time.

    A page says which frame it shows; the simulation goes on as it does. One that is hidden, paused
    or gone says nothing, and its character stands still.
    """

    def __init__(self, policies: Policies) -> None:
        self.policies = policies
        self._wake = threading.Condition()
        self._pages: collections.OrderedDict[int, _Page] = collections.OrderedDict()
        self._loading: set[str] = set()
        self._stopped = False
        self._compile = threading.Lock()  # one policy at a time
        self._thread = threading.Thread(target=self._work, name="steer", daemon=True)
        self._thread.start()

    def submit(self, page: int, request: Request, send: Send) -> None:
        """Do what a page asks for before its next control step."""
        with self._wake:
            known = self._pages.setdefault(page, _Page(send))
            if request.type == "shown":
                known.shown = min(max(known.shown, request.number), known.made)
            elif len(known.requests) >= _MOST_WAITING:
                raise MessageError("busy with earlier requests; try again in a moment")
            else:
                known.requests.append(request)
            self._wake.notify_all()

    def forget(self, page: int) -> None:
        """The page is gone, and its character with it."""
        with self._wake:
            self._pages.pop(page, None)

    def stop(self) -> None:
        """End the thread after the step at hand."""
        with self._wake:
            self._stopped = True
            self._wake.notify_all()
        self._thread.join(timeout=10)

    def _next(self) -> tuple[int, _Page] | None:
        """The page whose turn it is, each after all others; None: the end."""
        with self._wake:
            while not self._stopped:
                for number, page in self._pages.items():
                    if page.due:
                        self._pages.move_to_end(number)
                        return number, page
                self._wake.wait()
        return None

    def _work(self) -> None:
        while (turn := self._next()) is not None:
            number, page = turn
            request = None
            try:
                while page.requests:
                    request = page.requests.popleft()
                    self._do(number, page, request)
                request = None
                if page.character is not None and page.due:
                    frame = page.character.step()
                    page.made += 1
                    page.send(frame_message(page.made, frame))
            except Exception as error:  # told to the page; the others go on
                page.send(error_message(request, error))
                if request is None:
                    page.character = None  # it would fail again; a restart makes another one

    def _do(self, number: int, page: _Page, request: Request) -> None:
        if page.character is None:
            page.character = Character(self.policies.players, self.policies.rising, seed=number)
        character = page.character
        if request.type == "restart":
            character.restart()
        elif request.type == "push":
            character.push(math.radians(request.yaw_deg))
        elif request.type == "order":
            character.order(request.name, request.order)
        elif request.type == "policy":
            self._switch(number, page, request)

    def _switch(self, number: int, page: _Page, request: Request) -> None:
        """Switch, at once or when the policy is compiled; the character goes on meanwhile."""
        name = request.name
        if name in self.policies.players:
            assert page.character is not None
            page.character.switch(name)
        elif name not in self.policies.offers:
            known = ", ".join(self.policies.offers)
            raise MessageError(f"policy: expected one of {known}, got {name[:80]!r}")
        elif name not in self._loading:
            self._loading.add(name)
            task = threading.Thread(
                target=self._load, args=(number, page.send, request), daemon=True, name="load"
            )
            task.start()

    def _load(self, number: int, send: Send, request: Request) -> None:
        def log(text: str) -> None:
            print(text, file=sys.stderr, flush=True)
            send(json.dumps({"type": "loading", "name": request.name, "text": text}))

        try:
            with self._compile:
                self.policies.load(request.name, log)
        except Exception as error:  # told to the page; the first policy goes on
            send(error_message(None, error))
            return
        finally:
            self._loading.discard(request.name)
        with self._wake:
            if number in self._pages:
                self._pages[number].requests.append(request)
            for page in self._pages.values():
                page.send(json.dumps({"type": "policies", "policies": self.policies.describe()}))
            self._wake.notify_all()
