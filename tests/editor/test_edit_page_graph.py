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
        frame, ticks = box(page), shown_ticks(page)
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


def shown_ticks(page) -> list[float]:
    """Times along the axis of the first panel."""
    texts = page.locator(f'[aria-label="{HEIGHT}"] text[text-anchor="middle"]').all_text_contents()
    return [float(text) for text in texts]


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
