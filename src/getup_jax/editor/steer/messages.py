"""What a page that steers says, and what it is told; every message is checked."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any

from getup_jax.editor.messages import MessageError, pack
from getup_jax.editor.steer.character import Frame
from getup_jax.envs.composite.goals.combine import GOALS
from getup_jax.evaluation.steering_script import read_order

_MOST_BYTES = 4000
_TYPES = ("begin", "shown", "order", "policy", "restart", "push")


@dataclasses.dataclass(frozen=True)
class Request:
    """What a page asks for."""

    type: str  # one of _TYPES
    number: int = 0  # shown: of the newest frame on the screen
    name: str = ""  # order: of the goal; policy: of the policy
    order: dict[str, Any] = dataclasses.field(default_factory=dict)
    yaw_deg: float = 0.0  # push: where to


def read(message: str | bytes) -> Request:
    """The request in a message; MessageError or ConfigError say what is wrong with it."""
    if isinstance(message, bytes) or len(message) > _MOST_BYTES:
        raise MessageError(f"message: expected text of at most {_MOST_BYTES} letters")
    try:
        said = json.loads(message)
    except (ValueError, RecursionError):
        raise MessageError("message: expected JSON") from None
    kind = said.get("type") if isinstance(said, Mapping) else None
    if kind not in _TYPES:
        raise MessageError(f"message: expected a type of {', '.join(_TYPES)}")
    if kind == "shown":
        return Request(kind, number=_whole(said))
    if kind == "policy":
        return Request(kind, name=_text(said, "name"))
    if kind == "order":
        goal = _text(said, "goal")
        if goal not in GOALS:
            raise MessageError(f"goal: expected one of {', '.join(GOALS)}, got {goal[:80]!r}")
        return Request(kind, name=goal, order=read_order(goal, said.get("order"), goal))
    if kind == "push":
        return Request(kind, yaw_deg=_degrees(said))
    return Request(kind)


def frame_message(number: int, frame: Frame) -> bytes:
    """A frame: its header, then seven float32 a link."""
    header = {"type": "frame", "number": number, **frame.said}
    return pack(header, frame.links.astype("<f4").tobytes())


def _whole(said: Mapping[str, Any]) -> int:
    value = said.get("frame")
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**53:
        raise MessageError("frame: expected the number of a frame")
    return value


def _text(said: Mapping[str, Any], key: str) -> str:
    text = said.get(key)
    if not isinstance(text, str):
        raise MessageError(f"{key}: expected a name")
    return text


def _degrees(said: Mapping[str, Any]) -> float:
    value = said.get("yaw_deg", 0.0)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not -360.0 <= value <= 360.0:  # which NaN is not
        raise MessageError("yaw_deg: expected degrees from -360 to 360")
    return float(value)
