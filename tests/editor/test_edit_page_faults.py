"""What drove people away once, in headless Chromium."""

from __future__ import annotations

import numpy as np
import pytest
from browser import (
    BROWSER,
    FRONT,
    HEIGHT,
    achieved,
    drag,
    drawn,
    edited,
    judged,
    opened,
    picture,
    says,
    shot,
    value,
)

pytestmark = BROWSER
INSIDE = """() => [...document.querySelectorAll('button, select, input, canvas, .panel')]
  .filter((e) => e.getClientRects().length)
  .filter((e) => e.getBoundingClientRect().right > innerWidth + 1
    || e.getBoundingClientRect().left < -1)
  .map((e) => e.id || e.className || e.textContent)"""

SPOIL = """() => {  // every start becomes one that there is not
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (text) {
    send.call(this, text.replace(/"start":"[^"]*"/, '"start":"nothing"'));
  };
}"""


def test_any_name_may_be_typed_and_stops_no_motion(page_server):
    with opened(page_server[0]) as page:
        page.locator("#name").select_text()
        page.keyboard.type("Tom's rise, late/low")
        page.keyboard.press("Enter")
        assert page.input_value("#name") == "Toms rise latelow"
        edited(page, lambda: drag(page, HEIGHT, 4, 30))
        assert "Not simulated" not in page.inner_text("#verdict")


def test_a_field_shows_what_is_stored(page_server):
    with opened(page_server[0]) as page:
        for typed, kept in (("100", "20"), ("-3", "0.5"), ("3.456", "3.46")):
            page.fill("#seconds", typed)
            edited(page, lambda: page.press("#seconds", "Enter"))
            assert page.input_value("#seconds") == kept


def test_a_motion_that_is_refused_leaves_no_verdict_standing(page_server):
    with opened(page_server[0]) as page:
        judged(page)
        page.evaluate(SPOIL)
        drag(page, HEIGHT, 4, 30)
        says(page, "verdict", "Not simulated: curve: start")
        assert page.inner_text("#scores") == ""
        drawn(page)
        assert page.locator(f'[aria-label="{HEIGHT}"] .achieved').count() == 0


def test_variants_keep_their_own_motion_and_verdict_through_undo(page_server):
    with opened(page_server[0]) as page:
        judged(page)
        first = page.inner_text("#verdict"), achieved(page)
        edited(page, lambda: page.click("text=+ variant"))
        page.fill("#seconds", "8")
        edited(page, lambda: page.press("#seconds", "Enter"))
        page.click("#variants [role=tab] >> nth=0")
        drawn(page)
        page.keyboard.press("Control+z")
        page.keyboard.press("Control+z")
        drawn(page)
        assert page.get_attribute("#variants [role=tab] >> nth=0", "aria-selected") == "true"
        assert page.inner_text("#verdict") == first[0]
        # the whole ghost of the longer variant is there
        lines = page.locator(f'[aria-label="{HEIGHT}"] .ghost').all()
        assert sum(len(line.get_attribute("points").split()) for line in lines) > 10 * 30


def test_escape_takes_a_drag_back_and_keys_work_wherever_the_focus_is(page_server):
    with opened(page_server[0]) as page:
        old = value(page, HEIGHT, 4)
        box = page.locator(f'[aria-label="{HEIGHT}"] [data-point="4"]').bounding_box()
        page.mouse.move(box["x"] + 6, box["y"] + 6)
        page.mouse.down()
        page.mouse.move(box["x"] + 6, box["y"] - 40)
        assert value(page, HEIGHT, 4) > old
        page.keyboard.press("Escape")
        page.mouse.up()
        assert value(page, HEIGHT, 4) == old
        assert page.is_disabled("#undo")
        for selector in ("#theme", "#scrub", "#loop"):
            page.click(selector)
            before = page.inner_text("#play")
            page.keyboard.press("Space")
            assert page.inner_text("#play") != before, selector
        page.keyboard.press("End")
        drawn(page)
        late = page.inner_text("#clock")
        page.keyboard.press("Home")
        drawn(page)
        assert page.inner_text("#clock").startswith("0.00 s")
        assert late != page.inner_text("#clock")
        page.locator(f'[aria-label="{HEIGHT}"] [data-point="4"]').focus()
        for _ in range(5):
            page.keyboard.press("ArrowUp")
        page.locator("#duration").focus()
        page.keyboard.press("Control+z")
        assert value(page, HEIGHT, 4) == old


def test_a_drag_that_is_taken_back_does_not_go_on(page_server):
    """Of a point by undo, and of a slider by Escape, while the button is still held."""
    with opened(page_server[0]) as page:
        old, seconds = value(page, HEIGHT, 4), page.input_value("#seconds")
        point = page.locator(f'[aria-label="{HEIGHT}"] [data-point="4"]').bounding_box()
        x, y = point["x"] + 6, point["y"] + 6
        press(page, (x, y), (x, y - 40))
        assert value(page, HEIGHT, 4) > old
        page.keyboard.press("Control+z")
        page.mouse.move(x, y - 45)
        page.mouse.up()
        assert value(page, HEIGHT, 4) == old
        for slider in ("#duration", "#shift"):
            box = page.locator(slider).bounding_box()
            y = box["y"] + box["height"] / 2
            x = [box["x"] + share * box["width"] for share in (0.3, 0.6, 0.65)]
            press(page, (x[0], y), (x[1], y))
            assert page.is_enabled("#undo"), slider
            page.keyboard.press("Escape")
            page.mouse.move(x[2], y)
            page.mouse.up()
            drawn(page)
            assert page.is_disabled("#undo"), slider
            assert (page.input_value("#seconds"), page.input_value("#shift")) == (seconds, "0")
        edited(page, lambda: page.locator("#duration").press("ArrowRight"))
        assert page.input_value("#seconds") != seconds


def press(page, begin, end) -> None:
    """Drag, and keep the button down."""
    page.mouse.move(*begin)
    page.mouse.down()
    page.mouse.move(*end, steps=4)


def test_what_is_zoomed_reaches_over_no_numbers(page_server):
    with opened(page_server[0]) as page:
        page.click("#play")
        box = page.locator(f'[aria-label="{HEIGHT}"]').bounding_box()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        page.mouse.wheel(0, -600)
        drawn(page)
        for panel in (HEIGHT, FRONT):
            numbers = picture(page, f'[aria-label="{panel}"]')[24:-24, 2:26]
            assert np.ptp(numbers, axis=2).max() < 0.3, "there is a line over the numbers"


def test_a_field_that_takes_nothing_looks_like_it(page_server):
    with opened(page_server[0]) as page:
        for name in ("key-time", "key-value", "place", "region", "undo"):
            assert page.is_disabled(f"#{name}")
            opacity = page.locator(f"#{name}").evaluate("e => getComputedStyle(e).opacity")
            assert float(opacity) < 0.6, name


def test_variants_apart_are_all_in_the_picture(page_server):
    def columns() -> np.ndarray:
        """Which columns of the view are of a body: it is in colour, the ground is not."""
        page.wait_for_timeout(1500)  # the pictures are drawn one after the other
        view = picture(page, "#view")
        return (np.ptp(view[len(view) // 4 :], axis=2) > 0.15).any(axis=0)

    with opened(page_server[0]) as page:
        page.click("#play")
        for _ in range(3):
            edited(page, lambda: page.click("text=+ variant"))
        page.keyboard.press("End")
        page.check("#apart")
        seen = columns()
        shot(page, "apart")
        assert (np.diff(seen.astype(int)) == 1).sum() == 4
        assert not seen[:5].any()
        assert not seen[-5:].any()


@pytest.mark.parametrize("size", [(1024, 768), (1920, 1080), (390, 844)])
def test_nothing_is_outside_of_the_window(page_server, size):
    viewport = {"width": size[0], "height": size[1]}
    with opened(page_server[0], viewport=viewport) as page:
        page.click("#hint-close")
        assert page.evaluate(INSIDE) == []
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
        box = page.locator("#view").bounding_box()
        assert box["y"] + box["height"] <= size[1], "the view is below the fold"
        assert box["height"] > 150
        assert page.locator(".panel").last.bounding_box()["height"] > 80
        row = page.locator("#tools").bounding_box()["height"] < 40
        assert row or size[0] < 1900, "a tool has a row of its own"
        edited(page, lambda: page.select_option("#start", value="supine_situp_squat"))
        assert "Too far from the curves" in judged(page)
        whole = "e => e.scrollHeight <= e.clientHeight && e.getBoundingClientRect().bottom"
        bottom = page.locator("#verdict").evaluate(whole)
        edge = page.locator("#report").bounding_box()
        assert bottom, "the verdict is cut off"
        assert bottom <= edge["y"] + edge["height"]
        if size[0] > 900:
            words, tools = (page.locator(e).bounding_box() for e in ("#toast", "#left"))
            assert words["x"] > tools["x"] + tools["width"] - 1, "words lie on the tools"
