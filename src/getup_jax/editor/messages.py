"""What the page and the server say to each other over the WebSocket; every request is checked.

A request is JSON text with a `type`; only `import` is binary, since it carries a file. Answers
are JSON text too, but for frames and files: header length (uint32, little endian), JSON header,
payload.
"""

from __future__ import annotations

import dataclasses
import json
import math
import struct
from typing import Any

import numpy as np

from getup_jax.editor.export import FORMATS
from getup_jax.editor.simulate import Frames, Motion
from getup_jax.editor.starts import ANYWHERE, Place
from getup_jax.editor.takes import RATES, WHOLE, Cut
from getup_jax.editor.verdict import outcome
from getup_jax.motion.io.curve_file import MOST_PLACES, CurveFile, is_name, parse
from getup_jax.physics.terrain_map import REGIONS

MAX_TEXT_BYTES = 128_000
MAX_FILE_BYTES = 32_000_000
_LONGEST_S = 60.0  # of a motion
SLOTS = 4  # variants that a page may show at once
_MOST_LETTERS, _MARKS = 100, "_ ().+-"  # of a file's name
_LENGTH = struct.Struct("<I")


_TYPES = ("simulate", "judge", "save", "load", "export", "import", "recording", "cancel")
_NAMELESS = {"name": "curve", "strategy": "other"}  # where nothing is made that has a name


class MessageError(ValueError):
    """A message that the server does not answer; the text says why."""


@dataclasses.dataclass(frozen=True, eq=False)
class Request:
    """What a page asks for."""

    type: str  # one of _TYPES
    number: int  # the page's own, comes back with the answer
    slot: int = 0  # variant
    curve: CurveFile | None = None  # simulate, judge, save, export
    place: Place = ANYWHERE
    format: str = ""  # export
    cut: Cut = WHOLE  # export
    name: str = ""  # load, import: of the file; recording: of the clip
    of: int = 0  # cancel: number of the request
    content: str | bytes = b""  # load, import


def read(message: str | bytes) -> Request:
    """The request in a message; MessageError or MotionError say what is wrong with it."""
    content: str | bytes = b""
    if isinstance(message, bytes):
        text, content = _split(message)
    else:
        text = message
    if len(text) > MAX_TEXT_BYTES:
        raise MessageError(f"message: expected at most {MAX_TEXT_BYTES} bytes, got {len(text)}")
    try:
        said = json.loads(text)
    except (ValueError, RecursionError):
        raise MessageError("message: expected JSON") from None
    if not isinstance(said, dict):
        raise MessageError("message: expected a JSON object")
    kind, binary = said.get("type"), isinstance(message, bytes)
    if binary != (kind == "import") or kind not in _TYPES:
        raise MessageError(f"message: unknown type {str(kind)[:40]!r}")
    number = _whole(said, "number", 2**31)
    if kind in ("load", "import"):
        content = content if binary else _text(said)
        return Request(kind, number, name=_file_name(said), content=content)
    if kind == "recording":
        return Request(kind, number, name=_text(said, "name"))
    if kind == "cancel":
        return Request(kind, number, of=_whole(said, "of", 2**31))
    curve = _curve(said, kind)
    form = said.get("format", "")
    if kind == "export" and form not in FORMATS:
        raise MessageError(f"format: expected one of {', '.join(FORMATS)}")
    place = Place(_whole(said, "region", len(REGIONS), 0), _whole(said, "place", MOST_PLACES, 0))
    slot = _whole(said, "slot", SLOTS, 0)
    return Request(kind, number, slot, curve, place, form, _cut(said))


def _curve(said: dict[str, Any], kind: str) -> CurveFile:
    """The curve of a request; names matter only for files."""
    curve = said.get("curve")
    if kind != "save" and isinstance(curve, dict):
        name = {"name": said["name"]} if kind == "export" and "name" in said else {}
        curve = {**_NAMELESS, **curve, **name}
    return parse(curve, "curve")


def _cut(said: dict[str, Any]) -> Cut:
    """Which part is exported, and how."""
    rate, turn = said.get("rate"), said.get("turn", False)
    if rate is not None and (isinstance(rate, bool) or rate not in RATES):
        raise MessageError(f"rate: expected one of {', '.join(map(str, RATES))}")
    if not isinstance(turn, bool):
        raise MessageError("turn: expected true or false")
    end = None if said.get("to") is None else _seconds(said, "to")
    return Cut(rate, _seconds(said, "from"), end, turn)


def _seconds(said: dict[str, Any], key: str) -> float:
    value = said.get(key, 0.0)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not 0.0 <= value <= _LONGEST_S:  # which NaN is not
        raise MessageError(f"{key}: expected seconds from 0 to {_LONGEST_S:g}")
    return float(value)


def pack(header: dict[str, Any], payload: bytes) -> bytes:
    """A binary answer."""
    text = json.dumps(header).encode()
    # padded, so that the payload starts at a multiple of four bytes
    text += b" " * (-len(text) % 4)
    return _LENGTH.pack(len(text)) + text + payload


def frames_message(request: Request, frames: Frames, total: int) -> bytes:
    """Frames as float32: per frame 7 numbers a link, 3 features, and 1 while the episode runs."""
    count = len(frames.qpos)
    header = {"type": "frames", "number": request.number, "slot": request.slot}
    header |= {"first": frames.first, "count": count, "total": total}
    parts = [frames.links.reshape(count, -1), frames.features, frames.running[:, None]]
    return pack(header, np.concatenate(parts, axis=1).astype("<f4").tobytes())


def result_message(request: Request, motion: Motion, seconds: float) -> str:
    """Verdict and scores of a whole motion, and how long it took the server."""
    scores = {k: v if math.isfinite(v) else None for k, v in motion.scores.items()}
    header = {"type": "result", "number": request.number, "slot": request.slot}
    header |= {**outcome(motion), "scores": scores}
    gap = math.degrees(motion.start_gap_rad)
    return json.dumps({**header, "start_gap_deg": gap, "server_s": seconds})


def _split(message: bytes) -> tuple[str, bytes]:
    if len(message) < _LENGTH.size:
        raise MessageError("message: expected a header and a file")
    (length,) = _LENGTH.unpack_from(message)
    end = _LENGTH.size + length
    if length > MAX_TEXT_BYTES or end > len(message):
        raise MessageError("message: expected a header and a file")
    if len(message) - end > MAX_FILE_BYTES:
        raise MessageError(f"file: expected at most {MAX_FILE_BYTES // 1_000_000} MB")
    try:
        return message[_LENGTH.size : end].decode(), message[end:]
    except UnicodeDecodeError:
        raise MessageError("message: expected a header in UTF-8") from None


def _whole(said: dict[str, Any], key: str, end: int, default: int | None = None) -> int:
    value = said.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < end:
        raise MessageError(f"{key}: expected a whole number from 0 to {end - 1}")
    return value


def _file_name(said: dict[str, Any]) -> str:
    name = said.get("name")
    if (
        not isinstance(name, str)
        or not is_name(name, _MARKS, _MOST_LETTERS)
        or name.startswith(".")
    ):
        raise MessageError("name: expected the name of a file without its folder")
    return name


def _text(said: dict[str, Any], key: str = "text") -> str:
    text = said.get(key, "")
    if not isinstance(text, str):
        raise MessageError(f"{key}: expected a text")
    return text
