"""The editor in a real browser: a server in a process of its own, and headless Chromium.

Needs Debian's chromium and `pip install 'getup-jax[browser]'`. GETUP_EDIT_SHOTS names a folder
for screenshots.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
# nothing else: what the browser does by itself where there is no GPU is what is to be tested
_FLAGS = ("--no-sandbox",)
BROWSER = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (Debian: apt install chromium)"),
]
HEIGHT, SIDE, FRONT = "Neck height", "Lean to the side", "Lean forward"
_EDIT = "import sys; from getup_jax.cli.main import edit_main; sys.exit(edit_main(sys.argv[1:]))"


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
def opened(
    address: str, profile: Path | None = None, script: str = "", **context: Any
) -> Iterator[Any]:
    """The page at the address, with its first motion; what goes wrong in it fails the test.

    A profile keeps what a browser keeps when it is closed; a script changes the browser before.
    """
    reason = "needs pip install 'getup-jax[browser]'"
    sync_playwright = pytest.importorskip("playwright.sync_api", reason=reason).sync_playwright
    problems: list[str] = []
    options = {"viewport": {"width": 1280, "height": 800}, **context}
    with sync_playwright() as play:
        kind, started = play.chromium, {"executable_path": CHROMIUM, "args": list(_FLAGS)}
        if profile is None:
            holder = kind.launch(**started)
            page = holder.new_context(**options).new_page()
        else:
            holder = kind.launch_persistent_context(profile, **started, **options)
            page = holder.pages[0]
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.add_init_script(script)
        page.goto(address)
        page.wait_for_selector("body[data-shown]", timeout=120_000)
        yield page
        holder.close()
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
    wait_for_number(page, before)
    page.wait_for_function(
        "() => document.getElementById('latency').dataset.whole > 0", timeout=60_000
    )


def wait_for_number(page: Any, before: str) -> None:
    """Until the motion of a newer edit than number `before` has come."""
    page.wait_for_function(
        "before => Number(document.body.dataset.shown) > before", arg=int(before), timeout=60_000
    )


def says(page: Any, name: str, words: str) -> None:
    """Until the element with this id says the words."""
    page.wait_for_function(
        "([id, words]) => document.getElementById(id).textContent.includes(words)",
        arg=[name, words],
        timeout=60_000,
    )


def judged(page: Any) -> str:
    """The verdict, once there is one."""
    page.wait_for_function("() => document.getElementById('verdict').className !== ''")
    return page.inner_text("#verdict")


def memory_mib(process: subprocess.Popen[str]) -> float:
    """The most memory that the server has used so far (MiB)."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+) kB", status)[1]) / 1024


def shot(page: Any, name: str) -> None:
    """A screenshot for a person to look at, where one is asked for."""
    folder = os.environ.get("GETUP_EDIT_SHOTS")
    if folder:
        page.screenshot(path=str(Path(folder) / f"{name}.png"))


def shown(page: Any) -> str:
    """The number of the newest edit whose motion is whole."""
    return page.evaluate("document.body.dataset.shown")


def drawn(page: Any) -> None:
    """Until the page has drawn what was changed."""
    page.evaluate("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")


def value(page: Any, panel: str, point: int) -> float:
    """A control point's value (m or degrees)."""
    drawn(page)
    dot = page.locator(f'[aria-label="{panel}"] [data-point="{point}"]')
    return float(dot.get_attribute("aria-valuenow"))


def achieved(page: Any) -> str:
    """The line of the achieved height as the page draws it."""
    drawn(page)
    return page.locator(f'[aria-label="{HEIGHT}"] .achieved').first.get_attribute("points")


def new_project(page: Any) -> None:
    """By the dialog of projects."""
    page.click("#project")
    page.click("#project-new")


def saved(page: Any, click: str, folder: Path, **choices: str) -> Path:
    """The file that #save, or the dialog of exports with a format and choices, gives."""
    with page.expect_download(timeout=60_000) as download:
        if click.startswith("#"):
            page.click(click)
        else:
            page.click("#export")
            page.select_option("#format", click)
            for choice, value in choices.items():
                page.select_option(f"#{choice}", value)
            page.click("#export-go")
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path


def edited(page: Any, act: Callable[[], Any]) -> None:
    """Do something that asks for a new motion, and wait until it is whole."""
    before = shown(page)
    act()
    wait_for_result(page, before)


def picture(page: Any, selector: str) -> np.ndarray:
    """The pixels [height, width, 3] of an element, 0 to 1."""
    from matplotlib.image import imread

    return imread(io.BytesIO(page.locator(selector).screenshot()))[..., :3]


_SPIN = """import time
wall, cpu = time.perf_counter(), time.process_time()
while time.process_time() - cpu < {seconds}:
    pass
print((time.perf_counter() - wall) / (time.process_time() - cpu))
"""


def slowdown(seconds: float = 0.3) -> float:
    """How many times longer work takes here now than on a core of its own.

    Measured in a session of its own, as the browser is: Linux shares time among sessions.
    """
    command = [sys.executable, "-c", _SPIN.format(seconds=seconds)]
    said = subprocess.run(
        command, stdout=subprocess.PIPE, text=True, check=True, start_new_session=True
    )
    return float(said.stdout)


def cpu_seconds() -> float:
    """Processor time (s) of all processes that this one started: server, driver and browser."""
    parent, seconds = {}, {}
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = file.read_text().rpartition(")")[2].split()
            pid = int(file.parent.name)
            parent[pid] = int(fields[1])
            seconds[pid] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def ours(pid: int) -> bool:
        while pid in parent:
            pid = parent[pid]
            if pid == os.getpid():
                return True
        return False

    return sum(value for pid, value in seconds.items() if ours(pid))
