"""The editor in a real browser: a server in a process of its own, and headless Chromium."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
# nothing else: what the browser does by itself where there is no GPU is what is to be tested
_FLAGS = ("--no-sandbox",)
_EDIT = "import sys; from getup_jax.cli import edit_main; sys.exit(edit_main(sys.argv[1:]))"


@contextlib.contextmanager
def served(*options: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A running `getup-edit`, ready to simulate: its address and its process."""
    command = [sys.executable, "-c", _EDIT, *options]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        try:
            assert process.stdout is not None
            first, second = process.stdout.readline(), process.stdout.readline()
            found = re.search(r"http://\S+", first)
            assert found, f"no address in {first!r}"
            assert second.startswith("ready"), second
            yield found[0], process
        finally:
            process.terminate()
            process.wait(timeout=30)


@contextlib.contextmanager
def opened(address: str, **context: Any) -> Iterator[Any]:
    """The page at the address, with its first motion; what goes wrong in it fails the test."""
    from playwright.sync_api import sync_playwright

    problems: list[str] = []
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=list(_FLAGS))
        size = {"width": 1280, "height": 800}
        page = browser.new_context(**{"viewport": size, **context}).new_page()
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(address)
        page.wait_for_selector("body[data-shown]", timeout=120_000)
        yield page
        browser.close()
    assert not problems, problems


def drag(page: Any, panel: str, point: int, pixels: int) -> None:
    """Drag a control point up (positive) or down, in some steps as a hand does."""
    box = page.locator(f'[aria-label="{panel}"] [data-point="{point}"]').bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(1, 6):
        page.mouse.move(x, y - pixels * step / 5)
    page.mouse.up()


def wait_for_result(page: Any, before: str) -> None:
    """Until the motion of a newer edit than number `before` is whole."""
    page.wait_for_function(
        "before => Number(document.body.dataset.shown) > before", arg=int(before), timeout=60_000
    )
    page.wait_for_function(
        "() => document.getElementById('latency').dataset.whole > 0", timeout=60_000
    )


def memory_mib(process: subprocess.Popen[str]) -> float:
    """The most memory that the server has used so far (MiB)."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+) kB", status)[1]) / 1024
