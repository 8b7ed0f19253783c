"""Write docs/settings.md: every setting, its default, its range and its meaning.

    python docs/make_settings.py

The meaning is the comment above or beside a field in config/, so that there is one text.
"""

from __future__ import annotations

import dataclasses
import inspect
import typing
from pathlib import Path
from typing import Any

from getup_jax.config import CompositeConfig, Config, CurriculumConfig, GroupConfig, TerrainConfig
from getup_jax.config.load import to_dict
from getup_jax.config.ranges import range_of

FILE = Path(__file__).with_name("settings.md")
_INTRO = """\
# Every setting

Made by `python docs/make_settings.py` from the comments in `src/getup_jax/config/`. A config file
holds only what differs;
`getup-train flat SECTION.NAME=VALUE` changes any of it. `null` switches an optional section off.
"""


def text() -> str:
    """The whole page."""
    parts = [_INTRO]
    for key, cls, note in _sections():
        rows = [_row(key, f, cls) for f in dataclasses.fields(cls) if not _is_section(cls, f)]
        head = f"## {key or 'at the top'}{note}\n\n{_first_line(cls)}\n"
        table = ["| setting | default | range | meaning |", "|---|---|---|---|", *rows]
        parts.append("\n".join([head, *table, ""]) if rows else head)
    return "\n".join(parts)


def _sections() -> list[tuple[str, type, str]]:
    """Key, class and a note of every section, in the order of the config."""
    optional = {"curriculum": CurriculumConfig, "terrain": TerrainConfig}
    found: list[tuple[str, type, str]] = [("", Config, "")]
    default = Config()
    for field in dataclasses.fields(Config):
        value = getattr(default, field.name)
        if field.name in optional:
            found.append((field.name, optional[field.name], " (optional, default null)"))
        elif field.name == "composite":
            found.append(("composite", CompositeConfig, " (optional, default null)"))
            found.append(("composite.groups.NAME", GroupConfig, ""))
            discriminator = CompositeConfig.__dataclass_fields__["discriminator"].default_factory
            found.append(("composite.discriminator", typing.cast(type, discriminator), ""))
        elif dataclasses.is_dataclass(value):
            found.append((field.name, type(value), ""))
    return found


def _is_section(cls: type, field: dataclasses.Field[Any]) -> bool:
    hint = typing.get_type_hints(cls)[field.name]
    kinds = (hint, *typing.get_args(hint))
    return any(dataclasses.is_dataclass(kind) for kind in kinds) or field.name == "groups"


def _row(key: str, field: dataclasses.Field[Any], cls: type) -> str:
    default = field.default
    if field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    allowed = range_of(field)
    name = f"{key}.{field.name}" if key else field.name
    cells = (f"`{name}`", f"`{_shown(default)}`", str(allowed or ""), _comment(cls, field.name))
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _shown(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    value = to_dict(value) if dataclasses.is_dataclass(value) else value
    return str(list(value) if isinstance(value, tuple) else value)


def _first_line(cls: type) -> str:
    return (inspect.getdoc(cls) or "").partition("\n")[0]


def _comment(cls: type, name: str) -> str:
    """The comment lines above a field, and the one behind it."""
    lines = inspect.getsource(cls).splitlines()
    at = next(i for i, line in enumerate(lines) if line.strip().startswith(f"{name}:"))
    above = []
    for line in reversed(lines[:at]):
        if not line.strip().startswith("#"):
            break
        above.insert(0, line.strip().removeprefix("#").strip())
    end = at
    while lines[end].count("(") > lines[end].count(")"):
        end += 1
    beside = lines[at].partition("  # ")[2]
    return " ".join(part for part in (*above, beside) if part)


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
    print(FILE)
