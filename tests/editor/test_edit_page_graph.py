"""Curves as in a graph editor, with the mouse alone, in headless Chromium."""

from __future__ import annotations

import contextlib
import csv
import time

import numpy as np
import pytest
from browser import (
    BROWSER,
    FRONT,
    HEIGHT,
    SIDE,
    achieved,
    drag,
    drawn,
    edited,
    judged,
    opened,
    saved,
    says,
    shot,
    slowdown,
    value,
)

from getup_jax.motion.io.curve_file import read_curve_file

pytestmark = BROWSER


def box(page, panel: str = HEIGHT) -> dict[str, float]:
    return page.locator(f'[aria-label="{panel}"]').bounding_box()


def count(page, panel: str = HEIGHT) -> int:
    drawn(page)
    return page.locator(f'[aria-label="{panel}"] .point').count()


def seek(page, seconds: float) -> None:
    """Click on the axis below the last panel."""
    frame = box(page, FRONT)
    span = float(page.input_value("#seconds")) + 3
    across = frame["width"] - 52
    page.mouse.click(frame["x"] + 40 + across * seconds / span, frame["y"] + frame["height"] - 8)


def test_points_are_added_selected_scaled_copied_and_deleted(page_server):
    with opened(page_server[0]) as page:
        frame = box(page)
        edited(page, lambda: page.mouse.dblclick(frame["x"] + 130, frame["y"] + 40))
        assert count(page) == 10
        page.keyboard.press("Delete")
        assert count(page) == 9
        page.mouse.move(frame["x"] + 110, frame["y"] + 24)
        page.mouse.down()
        page.mouse.move(frame["x"] + 300, frame["y"] + frame["height"] - 25, steps=4)
        page.mouse.up()
        picked = page.locator(f'[aria-label="{HEIGHT}"] .point.picked').count()
        assert picked >= 3
        before = value(page, HEIGHT, 4)
        handle = page.locator(f'[aria-label="{HEIGHT}"] .handle.top').bounding_box()
        page.mouse.move(handle["x"] + 4, handle["y"] + 4)
        page.mouse.down()
        page.mouse.move(handle["x"] + 4, handle["y"] + 34, steps=3)
        edited(page, page.mouse.up)
        assert value(page, HEIGHT, 4) < before
        page.click("#key-copy")
        seek(page, 0.3)
        edited(page, lambda: page.click("#key-paste"))
        page.click("#pass-linear")
        shot(page, "graph")
        assert page.locator('.point[data-kind="linear"]').count() >= 3


def test_what_is_copied_from_one_angle_is_pasted_into_the_other(page_server):
    with opened(page_server[0]) as page:
        page.locator(f'[aria-label="{FRONT}"] [data-point="3"]').click()
        page.click("#key-copy")
        seek(page, 1.7)
        page.locator(f'[aria-label="{SIDE}"] [data-point="4"]').click()
        edited(page, lambda: page.click("#key-paste"))
        (pasted,) = page.locator(f'[aria-label="{SIDE}"] .point.picked').all()
        found = float(pasted.get_attribute("aria-valuenow"))
        assert found == pytest.approx(value(page, FRONT, 3), abs=0.06)  # a tenth of a degree


def test_a_frame_of_the_source_is_a_pose_to_wish_for(page_server):
    with opened(page_server[0]) as page:
        page.click("#play")
        old = value(page, HEIGHT, 4)
        edited(page, lambda: drag(page, HEIGHT, 4, 40))
        seek(page, 1.7)
        pose = "as its source is at the time at hand"
        page.select_option("#pose", label=pose)
        says(page, "toast", "Show the Source first")
        page.check("#source")
        page.wait_for_selector(".recorded")
        edited(page, lambda: page.select_option("#pose", label=pose))
        assert value(page, HEIGHT, 4) == pytest.approx(old, abs=0.08)
        # the same pose for another variant, at another time
        assert page.locator("#pose option[value=copied]").is_disabled()
        page.select_option("#pose", value="copy-source")
        says(page, "toast", "copied")
        page.uncheck("#source")
        edited(page, lambda: page.click("text=+ variant"))
        edited(page, lambda: page.select_option("#curve", label="supine_situp_squat"))
        seek(page, 0.6)
        edited(page, lambda: page.select_option("#pose", value="copied"))
        heights = [value(page, HEIGHT, i) for i in range(count(page))]
        assert min(abs(h - old) for h in heights[1:4]) < 0.08, heights


def test_time_and_value_are_typed_and_read(page_server):
    with opened(page_server[0]) as page:
        page.locator(f'[aria-label="{HEIGHT}"] [data-point="4"]').click()
        typed = float(page.input_value("#key-value"))
        assert typed == pytest.approx(value(page, HEIGHT, 4), abs=1e-3)
        page.fill("#key-value", "0.8")
        edited(page, lambda: page.press("#key-value", "Enter"))
        assert value(page, HEIGHT, 4) == 0.8
        page.fill("#key-time", "1.8")
        edited(page, lambda: page.press("#key-time", "Enter"))
        label = page.locator(f'[aria-label="{HEIGHT}"] [data-point="4"]').get_attribute(
            "aria-label"
        )
        assert "point 5 of 9, 1.80 s" in label  # as the help and the documents call it
        page.check("#frames")
        assert page.input_value("#key-time") == "54"
        page.keyboard.press("Control+a")
        drawn(page)
        assert page.is_disabled("#key-value"), "metres and degrees have no value in common"
        assert page.is_enabled("#key-time")


def test_two_fingers_zoom_the_curves_and_not_the_page(page_server):
    viewport = {"width": 390, "height": 844}
    with opened(page_server[0], viewport=viewport, has_touch=True, is_mobile=True) as page:
        page.click("#hint-close")
        page.locator(f'[aria-label="{HEIGHT}"]').scroll_into_view_if_needed()
        shot(page, "narrow")
        frame, ticks = box(page), shown_ticks(page)
        assert room(page) > 4, "the points lie on each other"
        before = page.evaluate("[visualViewport.scale, scrollY]")
        touch = page.context.new_cdp_session(page)
        middle, level = frame["x"] + 0.4 * frame["width"], frame["y"] + 0.5 * frame["height"]

        def fingers(kind: str, *places: float) -> None:
            points = [{"x": x, "y": level, "id": i} for i, x in enumerate(places)]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

        fingers("touchStart", middle - 20)
        fingers("touchStart", middle - 20, middle + 20)
        for step in range(1, 8):
            fingers("touchMove", middle - 20 - 8 * step, middle + 20 + 8 * step)
        fingers("touchEnd")
        drawn(page)
        zoomed = shown_ticks(page)
        assert zoomed[-1] - zoomed[0] < 0.6 * (ticks[-1] - ticks[0])
        assert page.evaluate("[visualViewport.scale, scrollY]") == before
        assert page.is_disabled("#undo"), "the fingers edited something"


def room(page) -> float:
    """The least distance between the edges of two points beside each other (px)."""
    return page.locator(f'[aria-label="{HEIGHT}"] .point').evaluate_all(
        """dots => Math.min(...dots.slice(1).map((dot, i) => dot.cx.baseVal.value
          - dots[i].cx.baseVal.value - 2 * parseFloat(getComputedStyle(dot).r) - 2))"""
    )


def shown_ticks(page) -> list[float]:
    """Times along the axis of the first panel."""
    texts = page.locator(f'[aria-label="{HEIGHT}"] text[text-anchor="middle"]').all_text_contents()
    return [float(text) for text in texts]


def test_curves_are_zoomed_moved_and_shown_whole_again(page_server):
    with opened(page_server[0]) as page:
        page.click("#play")
        frame, whole = box(page), shown_ticks(page)
        levels = page.locator(f'[aria-label="{HEIGHT}"] text[text-anchor="end"]').count()
        x, y = frame["x"] + frame["width"] / 2, frame["y"] + frame["height"] / 2
        page.mouse.move(x, y)
        page.mouse.wheel(0, -600)
        drawn(page)
        zoomed = shown_ticks(page)
        assert np.ptp(zoomed) < 0.6 * np.ptp(whole)
        page.keyboard.down("Shift")
        page.mouse.wheel(0, 300)
        page.keyboard.up("Shift")
        drawn(page)
        later = shown_ticks(page)
        assert later[0] > zoomed[0], "the wheel with Shift does not move them"
        page.keyboard.down("Alt")
        page.mouse.down()
        page.mouse.move(x + 120, y, steps=3)
        page.mouse.up()
        drawn(page)
        assert shown_ticks(page)[0] < later[0], "a drag with Alt does not move them"
        page.mouse.wheel(0, -900)
        page.keyboard.up("Alt")
        drawn(page)
        seen = page.locator(f'[aria-label="{HEIGHT}"] text[text-anchor="end"]').count()
        assert seen < levels, "the wheel with Alt does not zoom the values"
        page.keyboard.press("f")
        drawn(page)
        assert shown_ticks(page) == whole
        assert page.is_disabled("#undo"), "to look at the curves edits nothing"


def test_points_snap_and_what_the_policy_cannot_follow_is_shown(page_server):
    def dragged(right: float, up: float) -> tuple[float, float]:
        """Time (frames) and value (hundredths of a metre) of a point that is being dragged."""
        page.mouse.move(x + right, y - up)
        drawn(page)
        time_s, height = (float(page.input_value(f"#key-{name}")) for name in ("time", "value"))
        return 30 * time_s, 100 * height

    def off(numbers) -> float:
        """How far from whole numbers."""
        return float(np.abs(np.array(numbers) - np.round(numbers)).max())

    places = ((17, 23), (19, 27), (23, 31), (26, 33))
    with opened(page_server[0]) as page:
        page.click("#play")
        lines = page.locator(f'[aria-label="{HEIGHT}"] .fitted')
        assert lines.count() == 0
        assert page.locator(".error").count() == 3
        point = page.locator(f'[aria-label="{HEIGHT}"] [data-point="4"]').bounding_box()
        x, y = point["x"] + point["width"] / 2, point["y"] + point["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        assert off([dragged(*place) for place in places]) < 0.03  # the field has milliseconds
        page.keyboard.down("Control")
        assert off([dragged(*place) for place in places]) > 0.1, "Ctrl does not free it"
        page.keyboard.up("Control")
        page.keyboard.press("Escape")
        page.mouse.up()
        # a step between two of the nine control points is more than they can follow
        page.mouse.dblclick(x + 8, y - 40)
        page.mouse.dblclick(x + 14, y + 40)
        drawn(page)
        assert lines.count() == 1
        assert "nine control points" in lines.inner_html()
        for _ in range(2):
            page.keyboard.press("Control+z")
        drawn(page)
        assert lines.count() == 0
        edited(page, lambda: page.select_option("#start", value="supine_situp_squat"))
        mood = "near" if "by its own way" in judged(page) else "bad"
        assert mood in page.get_attribute("#verdict", "class").split()
        drawn(page)
        assert page.locator(".lost").count() > 0
        shot(page, mood)


@contextlib.contextmanager
def within_a_minute():
    """A task of a person who knows the page; longer where work takes longer here."""
    begin = time.perf_counter()
    yield
    took = time.perf_counter() - begin
    print(f"{took:.0f} s")
    assert took < 60 * max(1.0, slowdown())


def heights(page, folder) -> np.ndarray:
    """Time (s) and achieved height (m) [F, 2] of the motion that is shown."""
    rows = list(csv.DictReader(saved(page, "csv", folder).open()))
    return np.array([[float(row["time_s"]), float(row["achieved_height_m"])] for row in rows])


def test_slower_by_mouse_alone(page_server, tmp_path):
    with opened(page_server[0], accept_downloads=True) as page, within_a_minute():
        before = heights(page, tmp_path)
        edited(page, lambda: page.click("#stretch"))
        judged(page)
        assert float(page.input_value("#seconds")) == pytest.approx(5.1, abs=0.2)
        after = heights(page, tmp_path)
        first, later = (h[np.argmax(h[:, 1] > 1.2), 0] for h in (before, after))
        assert later > first + 0.5, "the body rises as fast as before"


def test_a_pause_on_hands_and_knees_by_mouse_alone(page_server, tmp_path):
    with opened(page_server[0], accept_downloads=True) as page, within_a_minute():
        edited(page, lambda: page.select_option("#curve", label="prone_quadruped_squat"))
        page.click("#play")
        seek(page, 1.2)
        for _ in range(2):
            edited(page, lambda: page.click("#hold"))
        seek(page, 1.3)
        page.click("#in")
        seek(page, 3.1)
        page.click("#out")
        edited(page, lambda: page.select_option("#pose", label="hands and knees"))
        judged(page)
        seek(page, 2.5)
        drawn(page)
        shot(page, "pause")
        scores = page.inner_text("#scores")
        assert "“hands and knees”" in scores, "it is not said what came of the wish"
        assert "left hand, right hand" in scores, scores
        assert "hand" in page.inner_text("#contacts")
        found = heights(page, tmp_path)
        during = found[(found[:, 0] > 1.8) & (found[:, 0] < 3), 1]
        assert np.ptp(during) < 0.15, "it does not pause"


def test_another_style_by_mouse_alone(page_server):
    with opened(page_server[0]) as page, within_a_minute():
        line = achieved(page)
        edited(page, lambda: page.select_option("#curve", label="supine_situp_squat"))
        judged(page)
        assert page.inner_text("#verdict").startswith("Stands")
        assert page.input_value("#start") == "supine_situp_squat"
        assert achieved(page) != line


def test_from_this_capture_but_lower_by_mouse_alone(page_server, tmp_path):
    with opened(page_server[0], accept_downloads=True) as page, within_a_minute():
        file = saved(page, "npz", tmp_path)
        edited(page, lambda: page.set_input_files("#file-motion", str(file)))
        judged(page)
        as_captured = heights(page, tmp_path)
        for point in (4, 5, 6):
            edited(page, lambda at=point: drag(page, HEIGHT, at, -16))
        judged(page)
        assert page.inner_text("#verdict").startswith("Stands")
        lower = heights(page, tmp_path)
        seconds = float(page.input_value("#seconds"))
        rise = (lower[:, 0] > 0.7 * seconds) & (lower[:, 0] < seconds)
        assert lower[rise, 1].mean() < as_captured[rise, 1].mean() - 0.1, "it is no lower"
        page.check("#source")
        page.wait_for_selector(".recorded")
        shot(page, "lower")
        assert read_curve_file(saved(page, "#save", tmp_path)).pose is not None
