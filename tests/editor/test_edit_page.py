"""Editing in the page, in headless Chromium, with the shipped policy."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest
from browser import (
    BROWSER,
    HEIGHT,
    SIDE,
    achieved,
    drag,
    drawn,
    edited,
    opened,
    picture,
    served,
    shot,
    shown,
    value,
    wait_for_number,
    wait_for_result,
)

pytestmark = BROWSER


def test_a_drag_changes_the_motion_and_can_be_undone(page_server):
    with opened(page_server[0]) as page:
        line, old = achieved(page), value(page, HEIGHT, 4)
        edited(page, lambda: drag(page, HEIGHT, 4, 40))
        assert value(page, HEIGHT, 4) > old + 0.1
        assert achieved(page) != line
        shot(page, "dragged")
        edited(page, lambda: page.keyboard.press("Control+z"))
        assert value(page, HEIGHT, 4) == old
        assert achieved(page) == line
        edited(page, lambda: page.keyboard.press("Control+Shift+Z"))
        assert value(page, HEIGHT, 4) > old + 0.1


def test_the_keyboard_moves_points_and_shift_mirror_reset_work(page_server):
    with opened(page_server[0]) as page:
        start, old = shown(page), value(page, HEIGHT, 3)
        page.locator(f'[aria-label="{HEIGHT}"] [data-point="3"]').focus()
        page.keyboard.press("ArrowUp")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("Shift+ArrowDown")
        assert value(page, HEIGHT, 3) == pytest.approx(old + 0.01, abs=1e-3)
        point = page.locator(f'[aria-label="{HEIGHT}"] [data-point="4"]')
        middle, place = value(page, HEIGHT, 4), point.bounding_box()["x"]
        page.locator("#shift").focus()
        for _ in range(6):
            page.keyboard.press("ArrowRight")
        assert value(page, HEIGHT, 4) == middle  # the rise comes later, and is the same
        assert point.bounding_box()["x"] > place + 5
        side = value(page, SIDE, 2)
        page.click("#mirror")
        assert value(page, SIDE, 2) == pytest.approx(180 - side, abs=0.11)
        assert page.input_value("#start").startswith("mirrored ")
        assert page.inner_text("#source-name") == "Source, mirrored"
        page.check("#source")
        page.wait_for_selector(".recorded")
        page.click("#reset")
        assert value(page, HEIGHT, 3) == old
        assert page.input_value("#start") == "prone_half_kneel_left"
        wait_for_result(page, start)


def test_time_stops_moves_by_frames_and_follows_the_curves(page_server):
    def clock() -> float:
        drawn(page)
        return float(page.inner_text("#clock").split()[0])

    with opened(page_server[0]) as page:
        page.locator("#view").focus()
        page.keyboard.press("Space")
        stopped = clock()
        page.wait_for_timeout(300)
        assert clock() == stopped
        for key, frames in ((".", 1), (".", 2), (",", 1)):
            page.keyboard.press(key)
            assert clock() == pytest.approx(stopped + frames / 30, abs=0.02)
        box = page.locator(f'[aria-label="{HEIGHT}"]').bounding_box()
        page.mouse.click(box["x"] + 0.8 * box["width"], box["y"] + 0.5 * box["height"])
        assert clock() > stopped + 1
        before = picture(page, "#view")
        page.locator("#view").focus()
        page.keyboard.press("ArrowLeft")
        page.wait_for_timeout(500)
        assert np.abs(picture(page, "#view") - before).mean() > 0.001, "the camera did not turn"


def test_the_strip_of_poses_follows_the_motion(page_server):
    with opened(page_server[0]) as page:
        page.wait_for_selector("#strip[data-drawn]")
        sky = picture(page, "#strip")[8, 8]
        first = picture(page, "#strip")
        bodies = np.abs(first - sky).max(axis=2) > 0.1
        columns = bodies.any(axis=0)
        assert (np.diff(columns.astype(int)) == 1).sum() >= 5, "expected seven poses side by side"
        number = page.get_attribute("#strip", "data-drawn")
        assert page.locator("#strip.stale").count() == 0
        box = page.locator(f'[aria-label="{HEIGHT}"] [data-point="4"]').bounding_box()
        page.mouse.move(box["x"] + 6, box["y"] + 6)
        page.mouse.down()
        page.mouse.move(box["x"] + 6, box["y"] + 66, steps=3)
        page.wait_for_selector("#strip.stale")  # as long as the motion is another one
        edited(page, page.mouse.up)
        page.wait_for_selector(f'#strip:not(.stale):not([data-drawn="{number}"])')
        assert np.abs(picture(page, "#strip") - first).max() > 0.1


def test_a_variant_stays_as_a_ghost_and_dark_is_readable(page_server):
    with opened(page_server[0], color_scheme="dark") as page:
        edited(page, lambda: page.click("text=+ variant"))
        edited(page, lambda: drag(page, HEIGHT, 4, 30))
        page.select_option("#band", index=1)
        assert page.locator(".ghost").count() >= 3
        assert page.locator(".band").count() == 3
        page.wait_for_timeout(2500)
        shot(page, "variants_dark")
        assert picture(page, "#view").mean() < 0.3, "the view is not dark"
        inside = page.evaluate(
            "[...document.querySelectorAll('button, select, input:not([hidden]), canvas, .panel')]"
            ".every(e => { const b = e.getBoundingClientRect();"
            " return b.bottom <= innerHeight && b.right <= innerWidth && b.left >= 0; })"
        )
        assert inside, "something is outside 1280 x 800"
        page.click("#theme")
        page.wait_for_timeout(2500)
        shot(page, "variants_light")
        assert picture(page, "#view").mean() > 0.7, "the view is not light"
        page.click("#variants [role=tab] >> nth=0")
        last = page.inner_text("#scores")
        page.click('[aria-label="Remove this variant"]')
        assert page.inner_text("#scores") != last
        assert page.locator("[role=tab]").count() == 1
        drawn(page)
        assert page.locator(".ghost").count() == 0


def test_the_view_looks_from_standard_directions(page_server):
    def seen() -> np.ndarray:
        """The view, once it no longer changes."""
        before = picture(page, "#view")
        for _ in range(20):
            page.wait_for_timeout(400)
            now = picture(page, "#view")
            if np.array_equal(now, before):
                return now
            before = now
        raise AssertionError("the view does not come to rest")

    with opened(page_server[0]) as page:
        page.click("#play")
        page.keyboard.press("End")
        views = {}
        for key in "0137":
            page.keyboard.press(key)
            views[key] = seen()
        for one, other in itertools.combinations(views, 2):
            assert np.abs(views[one] - views[other]).mean() > 0.003, (one, other)
        page.select_option("#standard", value="front")
        assert np.abs(seen() - views["1"]).mean() < 0.001
        assert page.input_value("#standard") == ""


def test_help_lists_every_key_and_the_hint_stays_away_once_it_was_read(page_server):
    with opened(page_server[0]) as page:
        assert page.is_visible("#hint")
        page.click("#hint-close")
        page.reload()
        page.wait_for_selector("body[data-shown]", timeout=60_000)
        assert page.is_hidden("#hint")
        page.locator("#band").focus()
        page.keyboard.press("h")  # goes to what begins with it in the list, and is no shortcut
        drawn(page)
        assert page.is_disabled("#undo")
        page.locator("#view").focus()
        before = page.inner_text("#play")
        page.keyboard.press("?")
        listed = page.locator("#help-list dt").all_inner_texts()
        assert {"Space", "I O", "Ctrl+C, Ctrl+V", "H", "F", "0 1 3 7", "?", "Esc"} <= set(listed)
        assert page.locator("#help-list dd").count() == len(listed)
        page.keyboard.press("Space")  # presses the dialog's own button
        assert page.inner_text("#play") == before
        if page.locator("#dialog").evaluate("dialog => dialog.open"):
            page.keyboard.press("Escape")
        assert not page.locator("#dialog").evaluate("dialog => dialog.open")


def test_a_lost_connection_keeps_the_edits_and_goes_on_with_them():
    with served("--port", "0") as (address, process), opened(address) as page:
        old = value(page, HEIGHT, 2)
        edited(page, lambda: drag(page, HEIGHT, 4, 30))
        fourth, line, last = value(page, HEIGHT, 4), achieved(page), shown(page)
        process.terminate()
        page.wait_for_selector("#banner:not([hidden])", timeout=20_000)
        assert "edits are kept" in page.inner_text("#banner")
        shot(page, "lost")
        drag(page, HEIGHT, 2, 10)
        second = value(page, HEIGHT, 2)
        process.wait(timeout=30)
        with served("--port", re.search(r":(\d+)", address)[1]):
            page.wait_for_selector("#banner", state="hidden", timeout=60_000)
            page.wait_for_selector("#dot.ok")
            wait_for_number(page, last)  # it was asked for again
            assert (value(page, HEIGHT, 4), value(page, HEIGHT, 2)) == (fourth, second)
            assert achieved(page) != line
            edited(page, lambda: page.keyboard.press("Control+z"))
            assert (value(page, HEIGHT, 4), value(page, HEIGHT, 2)) == (fourth, old)
            assert achieved(page) == line


def test_two_tabs_edit_for_themselves(page_server):
    with opened(page_server[0]) as page:
        other = page.context.new_page()
        other.goto(page_server[0])
        other.wait_for_selector("body[data-shown]", timeout=60_000)
        line, before = achieved(other), shown(page)
        drag(page, HEIGHT, 4, 40)
        wait_for_result(page, before)
        assert achieved(other) == line
        assert achieved(page) != line
