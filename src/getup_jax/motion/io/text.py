"""The text of motion files: the one place where bytes become characters.

Exporters write what their system does: with a byte order mark or without, in UTF-16, in an 8-bit
code page where a joint has a name of its language, with any line ends, padded with NULs or ended
by Control-Z. What a file says does not depend on it.
"""

from __future__ import annotations

import codecs
import json
import math
import re
from pathlib import Path
from typing import Any

from getup_jax.motion.clips import MotionError

MOST_BYTES = 256_000_000  # an hour of 60 joints at 60 Hz
MOST_LINES = 3_000_000
LARGEST = 1e9  # no length in any unit and no angle is larger
_MARKS = (  # the mark of UTF-32 begins with that of UTF-16
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_OTHERS = {  # first bytes -> what people have taken for a motion file
    b"PK\x03\x04": "a zip archive; unpack it",
    b"\x1f\x8b": "a gzip archive; unpack it",
    b"Kaydara FBX": "an FBX file; export it as BVH",
    b"glTF": "a glTF file; export it as BVH",
    b"<!DOCTYPE": "a web page; download the file itself",
    b"<html": "a web page; download the file itself",
}
_PADDING = "\0\x1a\ufffd \t\n"
_CONTROL = re.compile(r"[\0-\x08\x0e-\x1f]")
_COMMA = re.compile(r"[-+]?\d*,\d+")
_SHOWN = 40  # characters of what came instead
_HEAD = 1024  # characters that show whether a file is text
_EAST_ASIAN = re.compile(r"[\x00-\x7f\u3000-\u30ff\u4e00-\u9fff\uff01-\uff5e]*")
# One such character between Latin letters is an accented letter and its neighbour, misread.
_MISREAD = re.compile(
    r"[A-Za-z][\u3000-\uffff](?![\u3000-\uffff])|(?<![\u3000-\uffff])[\u3000-\uffff][A-Za-z]"
)


def read_bytes(path: Path) -> bytes:
    """The content of a file; MotionError where it cannot be read or is too large."""
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise MotionError(
                f"{path.name}: expected at most {MOST_BYTES // 1_000_000} MB, got "
                f"{size // 1_000_000} MB; cut the motion into several files"
            )
        return path.read_bytes()
    except OSError as error:
        raise MotionError(f"{path}: cannot be read: {error.strerror or error}") from None


def read_text(path: Path) -> str:
    """The text of a file with LF line ends and no padding.

    Raises MotionError where it cannot be read, is too large or is no text.
    """
    content = read_bytes(path)
    for first, kind in _OTHERS.items():
        if content[: len(first)].lower() == first.lower():
            raise MotionError(f"{path.name}: expected a motion file, got {kind}")
    text = decode(content)
    if _CONTROL.search(text, 0, _HEAD):
        raise MotionError(f"{path.name}: expected a text file, got binary data")
    return text


def read_lines(path: Path) -> list[str]:
    """The lines of a file; MotionError as `read_text`, and where there are too many."""
    text = read_text(path)
    if text.count("\n") >= MOST_LINES:
        raise MotionError(
            f"{path.name}: expected at most {MOST_LINES:,} lines; cut the motion into several files"
        )
    return text.split("\n")


def read_json(path: Path) -> Any:
    """The content of a JSON file; MotionError says what is wrong with it."""
    try:
        return json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise MotionError(f"{path.name}, line {error.lineno}: broken JSON: {error.msg}") from None
    except RecursionError:
        raise MotionError(f"{path.name}: expected a list of frames, got lists too deep") from None
    except ValueError:  # Python reads no number of thousands of digits
        raise MotionError(f"{path.name}: expected numbers, got one of too many digits") from None


def number(text: str) -> float | None:
    """The number that a word says, or None: not finite, not possible, or no number."""
    try:
        value = float(text) if "_" not in text else math.nan  # Python reads 1_0 as 10
    except ValueError:
        return None
    return value if abs(value) <= LARGEST else None


# what a message expects where `number` gives none
FINITE = f"a finite number of at most {LARGEST:g}"


def said(text: str) -> str:
    """A word as a message shows it, with a hint where its decimals have a comma."""
    hint = "; decimals take a point, not a comma" if _COMMA.fullmatch(text) else ""
    return f"{text[:_SHOWN]!r}{hint}"


def decode(content: bytes) -> str:
    """The characters that the bytes mean, with LF line ends and no padding."""
    mark, encoding = next(((m, e) for m, e in _MARKS if content.startswith(m)), (b"", None))
    encoding = encoding or _unmarked_utf16(content)
    content = content[len(mark) :]
    text = _guessed(content) if encoding is None else content.decode(encoding, "replace")
    if not text.isascii():
        text = text.replace("\ufeff", "")
    text = text.replace("\r\n", "\n").replace("\r", "\n").rstrip(_PADDING)
    end = text.find("\x1a")  # Control-Z: whatever follows is what the disk's block held before
    return (text if end < 0 else text[:end]).rstrip(_PADDING)


def _unmarked_utf16(content: bytes) -> str | None:
    """UTF-16 without a mark: every other byte of plain letters is 0."""
    even, odd = content[:128:2], content[1:128:2]
    if len(odd) > 1 and odd.count(0) > 0.8 * len(odd) and not even.count(0):
        return "utf-16-le"
    if len(odd) > 1 and even.count(0) > 0.8 * len(even) and not odd.count(0):
        return "utf-16-be"
    return None


def _guessed(content: bytes) -> str:
    """UTF-8, an East Asian code page or a Western one, whichever the bytes fit first.

    In the East Asian ones the second byte of a letter may look like a brace.
    """
    for encoding in ("utf-8", "cp932", "gb18030"):
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        if encoding == "utf-8" or (_EAST_ASIAN.fullmatch(text) and not _MISREAD.search(text)):
            return text
    try:
        return content.decode("cp1252")
    except UnicodeDecodeError:
        return content.decode("latin-1")
