"""YAML text as people write it into plain values; whatever is wrong is one line.

PyYAML's errors span several lines, and its conversions raise whatever Python's do: a number of
5,000 digits, a date without a day, brackets nested too deep for the stack.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from getup_jax.config.check import ConfigError, shown

MOST_BYTES = 500_000
_DEEPEST = 40  # nested lists and mappings
_LONGEST = 120  # characters of what the parser says, which quotes the text


class YamlError(ValueError):
    """The text is no YAML, or none that a file of ours may hold; `line` counts from 1."""

    def __init__(self, problem: str, line: int | None = None) -> None:
        super().__init__(problem)
        self.line = line


class BrokenFileError(ConfigError):
    """A file is not YAML; `problem` is the text without the file's name."""

    def __init__(self, file: Path, error: YamlError) -> None:
        place = "" if error.line is None else f", line {error.line}"
        self.problem = f"broken YAML: {error}"
        super().__init__(f"{file}{place}: {self.problem}")


def read(path: Path) -> Any:
    """The value in a YAML file; ConfigError says why there is none, and in which line."""
    try:
        return parse(path.read_bytes())
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None
    except YamlError as error:
        raise BrokenFileError(path, error) from None


def parse(text: str | bytes) -> Any:
    """The value of a YAML text: dicts, lists and scalars. Bytes are UTF-8, or UTF-16 with a BOM.

    A key given twice is an error, not a silent choice. Raises YamlError.
    """
    if len(text) > MOST_BYTES:
        raise YamlError(f"expected at most {MOST_BYTES} bytes, got {len(text)}")
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        problem = (error.problem or "not YAML")[:_LONGEST]
        raise YamlError(problem, mark and mark.line + 1) from None
    except yaml.reader.ReaderError as error:
        found = f"0x{error.character:02x} at position {error.position}"
        raise YamlError(f"not text: {error.reason} ({found})") from None


class _Loader(yaml.SafeLoader):
    """A safe loader with bounds, whose errors all have a place."""

    _depth = 0

    def fetch_flow_collection_start(self, TokenClass: type[yaml.Token]) -> None:
        """As the parent's, which looks far ahead of what is composed."""
        if self.flow_level >= _DEEPEST:
            raise _too_deep(self.get_mark())
        super().fetch_flow_collection_start(TokenClass)

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """As the parent's, down to a certain depth."""
        self._depth += 1
        if self._depth > _DEEPEST:
            raise _too_deep(self.peek_event().start_mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """As the parent's, whatever Python's conversions raise."""
        try:
            return super().construct_object(node, deep)
        except (ValueError, LookupError, AttributeError, TypeError, ArithmeticError):
            kind = node.tag.rpartition(":")[2]
            raise _error(f"{shown(node.value)} cannot be read as {kind}", node.start_mark) from None

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """As the parent's, after a check for repeated keys."""
        seen = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                raise _error(f"the key {shown(key.value)} appears twice", key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def _too_deep(mark: yaml.Mark) -> yaml.MarkedYAMLError:
    return _error(f"nested more than {_DEEPEST} deep", mark)


def _error(problem: str, mark: yaml.Mark) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=mark)
