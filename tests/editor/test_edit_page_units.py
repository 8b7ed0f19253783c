"""The page's modules without a browser: their unit tests in Node, and their types."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

UNITS = Path(__file__).parent / "page"
NODE = shutil.which("node")
LOCAL_TSC = UNITS / "node_modules" / ".bin" / "tsc"
TSC = str(LOCAL_TSC) if LOCAL_TSC.exists() else shutil.which("tsc")


def node_version() -> tuple[int, ...]:
    """Of the Node that is there; empty: there is none."""
    if NODE is None:
        return ()
    said = subprocess.run([NODE, "--version"], capture_output=True, text=True, check=True).stdout
    return tuple(int(part) for part in re.findall(r"\d+", said))


@pytest.mark.skipif(node_version() < (20, 19), reason="needs Node 20.19 or newer")
def test_the_unit_tests_of_the_page_pass():
    files = sorted(str(path) for path in UNITS.glob("*.test.js"))
    command = [NODE, "--test", "--test-reporter=tap", *files]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    passed = re.search(r"^# pass (\d+)$", done.stdout, re.MULTILINE)
    assert passed is not None
    assert int(passed[1]) >= len(files), "no test was run"


@pytest.mark.skipif(TSC is None, reason="needs tsc: npm install in tests/editor/page")
def test_the_types_of_the_page_are_right():
    done = subprocess.run([str(TSC), "-p", str(UNITS)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout[-4000:]
