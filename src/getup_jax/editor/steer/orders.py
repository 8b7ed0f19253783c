"""What a character is told by hand, and whether it got there."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any


@dataclasses.dataclass
class Heard:
    """One order."""

    order: dict[str, Any]
    since_s: float | None = None  # when a policy first heard it; None: none that acts did yet
    reached_after_s: float | None = None


class Told:
    """The newest order for every goal; it holds until the next one, past its time too."""

    def __init__(self) -> None:
        self._heard: dict[str, Heard] = {}

    def hear(self, goal: str, order: dict[str, Any]) -> None:
        """An order, in place of the last one."""
        self._heard[goal] = Heard(order)

    def orders(self, names: Sequence[str], now: float) -> dict[str, tuple[dict[str, Any], float]]:
        """Of the goals that act now (s): the order and its age (s), as `Goals.steer` wants it."""
        found = {}
        for goal in self._heard.keys() & set(names):
            heard = self._heard[goal]
            heard.since_s = now if heard.since_s is None else heard.since_s
            found[goal] = (heard.order, now - heard.since_s)
        return found

    def see(self, names: Sequence[str], states: Sequence[Any], now: float) -> None:
        """Note the moment when a target was reached."""
        for name, state in zip(names, states, strict=True):
            heard, reached = self._heard.get(name), getattr(state, "reached", None)
            if heard is None or heard.since_s is None or heard.reached_after_s is not None:
                continue
            if reached is not None and bool(reached[0]):
                heard.reached_after_s = now - heard.since_s

    def plain(self, goal: str) -> dict[str, Any] | None:
        """The order for a goal, and after how long it was reached (s); None: there is none."""
        heard = self._heard.get(goal)
        if heard is None:
            return None
        return {"order": heard.order, "reached_after_s": heard.reached_after_s}
