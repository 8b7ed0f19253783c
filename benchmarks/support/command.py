"""How a benchmark runs as a command."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path


def command(main: Callable[[], None]) -> None:
    """Run it; what is wrong with its arguments or files is one line and exit code 2."""
    try:
        main()
    except Exception as error:
        if not type(error).__module__.startswith(("getup_jax.", "support.")):
            raise
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        sys.exit(2)


def parser_of(doc: str | None) -> argparse.ArgumentParser:
    """The arguments that every benchmark of a config has: settings, --config, --json, --quick."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("settings", nargs="*", metavar="section.key=value", help="changes of the config")
    add("--config", default="flat", help="a config file or a shipped config (default: flat)")
    add("--json", type=Path, metavar="FILE", help="write the result to this file")
    add("--quick", action="store_true", help="smallest sizes, to see that it works: no rates")
    return parser


def positive(text: str) -> int:
    """A whole number of at least 1 among the arguments."""
    number = int(text) if text.isdecimal() and len(text) < 10 else 0
    if number < 1:
        raise argparse.ArgumentTypeError(
            f"expected a whole number of at least 1, got {text[:40]!r}"
        )
    return number


def duration(text: str) -> float:
    """A time (s) of at least 0 among the arguments."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 <= number < 1e6:
        raise argparse.ArgumentTypeError(f"expected seconds, at least 0, got {text[:40]!r}")
    return number
