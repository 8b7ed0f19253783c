"""The HIERARCHY part of BVH files, with errors that name file, line and joint.

It is read as a stream of words: keywords in any case, braces anywhere, values over several lines.
A name is all that stands between ROOT or JOINT and the end of its line or the brace.
"""

from __future__ import annotations

import dataclasses
import difflib
import re
from collections.abc import Iterator, Sequence

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.text import FINITE, number, said

CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")
_MOST_LINES = 300_000  # up to MOTION
MOST_JOINTS = 2000  # ten times a body with fingers, face and clothes
_BY_SPELLING = {name.lower(): name for name in CHANNELS}
_NAMED = ("ROOT", "JOINT", "END")
_KEYWORDS = {name: name for name in (*_NAMED, "OFFSET", "CHANNELS", "MOTION")}
_KEYWORDS["ENDSITE"] = "END"
_MOST_WORDS = 100  # of one statement
_WORD = re.compile(r"[{}]|[^\s{}]+")
_COMMENT = re.compile(r"(?:^|\s)(?:#|//|;).*")
_LONGEST_NAME = 200  # characters


@dataclasses.dataclass
class Joint:
    """One joint as the file describes it, in file units."""

    name: str
    parent: int
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    channels: tuple[str, ...] = ()
    end: tuple[float, ...] | None = None  # the offset of its End Site


def without_comment(line: str) -> str:
    """A line up to `#`, `//` or `;` at the start of a word."""
    return _COMMENT.sub("", line) if "#" in line or "//" in line or ";" in line else line


def read_hierarchy(name: str, lines: Sequence[str]) -> tuple[list[Joint], int]:
    """The joints, and the number of lines up to and with MOTION; `name` is the file's."""
    parser = _Parser(name)
    for at, line in enumerate(lines[:_MOST_LINES], 1):
        if parser.feed(at, _words(without_comment(line))):
            return parser.joints, at
    if not parser.begun:
        raise MotionError(f"{name}: expected HIERARCHY, got nothing; not a BVH file")
    raise MotionError(
        f"{name}: expected a MOTION section, got none in {min(len(lines), _MOST_LINES)} lines; the "
        "file is cut off"
    )


def _words(line: str) -> Iterator[str]:
    return (match.group() for match in _WORD.finditer(line))


def number_of(file: str, line: int, what: str, text: str) -> float:
    """The finite number that a word says."""
    value = number(text)
    if value is None:
        got = said(text)
        raise MotionError(f"{file}, line {line}: {what}: expected {FINITE}, got {got}")
    return value


class _Parser:
    """Feeds on one line of the hierarchy at a time."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.joints: list[Joint] = []
        self.begun = False
        self._stack: list[int] = []  # open braces: joint index, or -1 for an End Site
        self._next: int | None = None  # what the next brace opens
        self._key, self._line = "", 0  # the open statement, and where it began
        self._words: list[str] = []

    def feed(self, number: int, words: Iterator[str]) -> bool:
        """One line's words; True at MOTION."""
        for word in words:
            keyword = word.upper().rstrip(":")
            if not self.begun:
                if keyword != "HIERARCHY":
                    self._fail(number, f"expected HIERARCHY, got {said(word)}; not a BVH file")
                self.begun = True
            elif word in "{}":
                self._close()
                self._brace(number, word)
            elif self._key in _NAMED and (self._line == number or not self._words):
                self._take(number, word)
            elif keyword in _KEYWORDS:
                self._close()
                if keyword == "MOTION":
                    self._finish(number)
                    return True
                self._key, self._line, self._words = _KEYWORDS[keyword], number, []
            else:
                self._take(number, word)
        return False

    def _take(self, number: int, word: str) -> None:
        """A word of the open statement."""
        if not self._key:
            expected = "expected ROOT, JOINT, End Site, OFFSET or CHANNELS"
            self._fail(number, f"{expected}, got {said(word)}")
        if len(self._words) >= _MOST_WORDS:
            self._fail(self._line, f"{self._key}: expected at most {_MOST_WORDS} words, got more")
        self._words.append(word)

    def _close(self) -> None:
        """Read the statement that ends here."""
        key, self._key = self._key, ""
        if key and self._next is not None:
            self._fail(self._line, f"expected an opening brace before {key}")
        if key in ("ROOT", "JOINT"):
            self._open_joint(self._line, " ".join(self._words), key)
        elif key == "END":
            self._next = -1
        elif key == "OFFSET":
            self._offset(self._line, self._words)
        elif key == "CHANNELS":
            self._channels(self._line, self._words)

    def _finish(self, number: int) -> None:
        if self._next is not None:
            self._fail(number, "expected an opening brace, got MOTION")
        if self._stack:
            self._fail(number, f"{len(self._stack)} braces are still open")
        if not self.joints:
            self._fail(number, "expected at least one joint, got none")

    def _open_joint(self, number: int, name: str, key: str) -> None:
        parent = self._stack[-1] if self._stack else -1
        if key == "JOINT" and parent < 0:
            self._fail(number, f"JOINT {name} has no parent")
        if key == "ROOT" and self._stack:
            self._fail(number, f"ROOT {name}: {len(self._stack)} braces are still open")
        if len(self.joints) >= MOST_JOINTS:
            self._fail(number, f"expected at most {MOST_JOINTS} joints, got more; no human body")
        self._next = len(self.joints)
        name = name.strip("\"'")[:_LONGEST_NAME] or f"joint {self._next}"
        self.joints.append(Joint(name, parent))

    def _brace(self, number: int, brace: str) -> None:
        if brace == "{" and self._next is None:
            self._fail(number, "an opening brace without ROOT, JOINT or End Site")
        if brace == "}" and self._next is not None:
            self._fail(number, "expected an opening brace, got a closing one")
        if brace == "}" and not self._stack:
            self._fail(number, "a closing brace without an opening one")
        if self._next is None:
            self._stack.pop()
        else:
            self._stack.append(self._next)
            self._next = None

    def _offset(self, number: int, words: Sequence[str]) -> None:
        values = tuple(number_of(self.file, number, "OFFSET", word) for word in words)
        if not self._stack:
            self._fail(number, "OFFSET outside a joint")
        joint = self._joint()
        if len(values) != 3:
            got = f"expected 3 numbers inside a joint, got {len(values)}"
            self._fail(number, f"joint {joint.name}: OFFSET: {got}")
        if self._stack[-1] < 0:
            joint.end = values
        else:
            joint.offset = values

    def _channels(self, number: int, words: Sequence[str]) -> None:
        names = tuple(_BY_SPELLING.get(word.lower(), word) for word in words[1:])
        if not self._stack:
            self._fail(number, "CHANNELS outside a joint")
        if self._stack[-1] < 0 and names:
            self._stack[-1] = self._moving_end()
        joint = self._joint()
        if not words or words[0] != str(len(names)):
            says = said(words[0]) if words else "no number"
            self._fail(number, f"joint {joint.name}: CHANNELS says {says}, lists {len(names)}")
        for name in names:
            if name not in CHANNELS or names.count(name) > 1:
                close = difflib.get_close_matches(name, set(CHANNELS) - set(names), n=1)
                hint = f"; did you mean {close[0]}?" if close else ""
                kind = "unknown channel" if name not in CHANNELS else "twice the channel"
                self._fail(number, f"joint {joint.name}: {kind} {said(name)}{hint}")
        if self._stack[-1] >= 0:
            joint.channels = names

    def _joint(self) -> Joint:
        """The innermost open joint."""
        return self.joints[next(index for index in reversed(self._stack) if index >= 0)]

    def _moving_end(self) -> int:
        """An End Site with channels of its own is a joint."""
        above = self._stack[-2]
        parent = self.joints[above]
        self.joints.append(Joint(f"{parent.name} end", above, parent.end or (0.0, 0.0, 0.0)))
        return len(self.joints) - 1

    def _fail(self, number: int, text: str) -> None:
        raise MotionError(f"{self.file}, line {number}: {text}")
