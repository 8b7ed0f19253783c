"""The page in headless Chromium, with the shipped policy; run by `make test-slow`.

Needs Debian's chromium and `pip install 'getup-jax[browser]'`. GETUP_EDIT_SHOTS names a folder
for screenshots.
"""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, drag, memory_mib, opened, served, wait_for_result

from getup_jax import cli
from getup_jax.motion.bvh import read_bvh
from getup_jax.motion.curve_file import read_curve_file

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (Debian: apt install chromium)"),
]
HEIGHT = "Neck height"


@pytest.fixture(scope="module")
def server():
    pytest.importorskip("playwright", reason="needs pip install 'getup-jax[browser]'")
    with served("--port", "0") as running:
        yield running


def shot(page, name: str) -> None:
    folder = os.environ.get("GETUP_EDIT_SHOTS")
    if folder:
        page.screenshot(path=str(Path(folder) / f"{name}.png"))


def shown(page) -> str:
    return page.evaluate("document.body.dataset.shown")


def drawn(page) -> None:
    """Until the page has drawn what was changed."""
    page.evaluate("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")


def value(page, panel: str, point: int) -> float:
    drawn(page)
    dot = page.locator(f'[aria-label="{panel}"] [data-point="{point}"]')
    return float(dot.get_attribute("aria-valuenow"))


def achieved(page) -> str:
    """The line of the achieved height as the page draws it."""
    drawn(page)
    return page.locator(f'[aria-label="{HEIGHT}"] .achieved').first.get_attribute("points")


def saved(page, click: str, folder: Path) -> Path:
    with page.expect_download(timeout=60_000) as download:
        page.click(click) if click.startswith("#save") else page.select_option("#export", click)
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path


def test_a_drag_changes_the_motion_and_can_be_undone(server):
    with opened(server[0]) as page:
        before = shown(page)
        page.fill("#seconds", "5")
        page.press("#seconds", "Enter")
        wait_for_result(page, before)  # 8 s with the standing phase
        before, line, old = shown(page), achieved(page), value(page, HEIGHT, 4)
        drag(page, HEIGHT, 4, 40)
        wait_for_result(page, before)
        assert value(page, HEIGHT, 4) > old + 0.1
        assert achieved(page) != line
        shot(page, "dragged")
        first = float(page.locator("#latency").get_attribute("data-first"))
        print(f"first new frame {first:.0f} ms after release: {page.inner_text('#latency')}")
        print(f"memory of the server: {memory_mib(server[1]):.0f} MiB")
        assert memory_mib(server[1]) < 1024
        before = shown(page)
        page.keyboard.press("Control+z")
        wait_for_result(page, before)
        assert value(page, HEIGHT, 4) == old
        assert achieved(page) == line


def test_what_is_saved_opens_again_and_evaluates_the_same(server, tmp_path):
    with opened(server[0], accept_downloads=True) as page:
        before = shown(page)
        page.fill("#name", "my_rise")
        drag(page, HEIGHT, 5, -25)
        wait_for_result(page, before)
        file = saved(page, "#save", tmp_path)
        scores, moved = page.inner_text("#scores"), value(page, HEIGHT, 5)
        verdict = page.inner_text("#verdict")
        page.evaluate("sessionStorage.clear()")
        page.reload()
        page.wait_for_selector("body[data-shown]", timeout=60_000)
        assert value(page, HEIGHT, 5) != moved
        before = shown(page)
        page.set_input_files("#file-curve", str(file))
        wait_for_result(page, before)
        assert value(page, HEIGHT, 5) == moved
        assert page.inner_text("#scores") == scores
    assert read_curve_file(file).values[5, 0] == moved
    out = tmp_path / "out.json"
    assert cli.eval_main(["--curves", str(file), "--json", str(out)]) == 0
    found = json.loads(out.read_text())
    assert found["success"] == float(verdict.startswith("Stands"))
    assert f"height error {found['height_error_m']:.3f} m" in scores
    assert f"energy {found['energy_j']:.0f} J" in scores


def test_exports(server, tmp_path):
    with opened(server[0], accept_downloads=True) as page:
        files = {kind: saved(page, kind, tmp_path) for kind in ("bvh", "npz", "csv")}
    recording = read_bvh(files["bvh"])
    with np.load(files["npz"]) as data:
        assert len(data["qpos"]) == recording.num_frames
    assert len(files["csv"].read_text().splitlines()) == recording.num_frames + 1


def test_the_keyboard_moves_points_and_shift_mirror_reset_work(server):
    with opened(server[0]) as page:
        start, old = shown(page), value(page, HEIGHT, 3)
        page.locator(f'[aria-label="{HEIGHT}"] [data-point="3"]').focus()
        page.keyboard.press("ArrowUp")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("Shift+ArrowDown")
        assert value(page, HEIGHT, 3) == pytest.approx(old + 0.01, abs=1e-6)
        middle = value(page, HEIGHT, 4)
        page.locator("#shift").focus()
        for _ in range(6):
            page.keyboard.press("ArrowRight")
        assert value(page, HEIGHT, 4) != middle
        side = value(page, "Side to up", 2)
        page.click("#mirror")
        assert value(page, "Side to up", 2) == pytest.approx(180 - side, abs=0.11)
        assert page.input_value("#start").startswith("mirrored ")
        page.click("#reset")
        assert value(page, HEIGHT, 3) == old
        assert page.input_value("#start") == "prone_half_kneel_left"
        wait_for_result(page, start)


def test_a_variant_stays_as_a_ghost_and_dark_is_readable(server):
    with opened(server[0], color_scheme="dark") as page:
        page.click("text=+ variant")
        before = shown(page)
        drag(page, HEIGHT, 4, 30)
        wait_for_result(page, before)
        page.select_option("#band", index=1)
        assert page.locator(".ghost").count() >= 3
        assert page.locator(".band").count() == 3
        page.wait_for_timeout(2500)
        shot(page, "variants_dark")
        inside = page.evaluate(
            "[...document.querySelectorAll('button, select, input:not([hidden]), canvas, .panel')]"
            ".every(e => { const b = e.getBoundingClientRect();"
            " return b.bottom <= innerHeight && b.right <= innerWidth && b.left >= 0; })"
        )
        assert inside, "something is outside 1280 x 800"


def test_a_lost_connection_keeps_the_edits(server):
    with served("--port", "0") as (address, process), opened(address) as page:
        drag(page, HEIGHT, 4, 30)
        edited = value(page, HEIGHT, 4)
        process.terminate()
        page.wait_for_selector("#banner:not([hidden])", timeout=20_000)
        assert "edits are kept" in page.inner_text("#banner")
        drag(page, HEIGHT, 2, 10)
        further = value(page, HEIGHT, 2)
        process.wait(timeout=30)
        port = re.search(r":(\d+)", address)[1]
        with served("--port", port):
            page.wait_for_selector("#banner", state="hidden", timeout=60_000)
            page.wait_for_selector("#dot.ok")
            assert (value(page, HEIGHT, 4), value(page, HEIGHT, 2)) == (edited, further)


def test_two_tabs_edit_for_themselves(server):
    with opened(server[0]) as page:
        other = page.context.new_page()
        other.goto(server[0])
        other.wait_for_selector("body[data-shown]", timeout=60_000)
        line, before = achieved(other), shown(page)
        drag(page, HEIGHT, 4, 40)
        wait_for_result(page, before)
        assert achieved(other) == line
        assert achieved(page) != line


def test_a_file_that_is_no_curve_file_is_refused_with_a_reason(server, tmp_path):
    bad = tmp_path / "bad.yaml"
    bad.write_text("height: [1, 2]\n")
    with opened(server[0]) as page:
        page.set_input_files("#file-curve", str(bad))
        page.wait_for_selector("#toast.bad")
        assert "bad.yaml: expected the keys name" in page.inner_text("#toast")
