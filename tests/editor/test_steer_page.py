"""Steering in the page, in headless Chromium, with the shipped policies that walk."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from typing import Any

import pytest
from browser import BROWSER, CHROMIUM, says, served, shot

pytestmark = BROWSER


@pytest.fixture(scope="module")
def steered() -> Iterator[str]:
    """A running `getup-edit` with two policies: its address."""
    pytest.importorskip("playwright", reason="needs pip install 'getup-jax[browser]'")
    with served("--ckpt", "walk", "--with", "walk_aim", "--port", "0") as (address, _):
        yield address


@contextlib.contextmanager
def opened(address: str, width: int = 1280, height: int = 800) -> Iterator[Any]:
    """The page once the character walks; what goes wrong in it fails the test."""
    from playwright.sync_api import sync_playwright

    problems: list[str] = []
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": width, "height": height})
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(address)
        until_frame(page, 30)
        yield page
        browser.close()
    assert not problems, problems


def frame(page: Any) -> int:
    return int(page.evaluate("document.body.dataset.frame ?? 0"))


def until_frame(page: Any, number: int) -> None:
    page.wait_for_function(
        "number => Number(document.body.dataset.frame) >= number", arg=number, timeout=60_000
    )


def click_floor(page: Any, across: float, down: float) -> None:
    box = page.locator("#view").bounding_box()
    page.mouse.click(box["x"] + across * box["width"], box["y"] + down * box["height"])


def told(page: Any, goal: str) -> str:
    return page.inner_text(f'[data-goal="{goal}"] p')


def distance(page: Any) -> float:
    return float(re.match(r"([\d.]+) m away", told(page, "target_location"))[1])


def test_it_walks_to_where_the_floor_was_clicked_also_as_another_policy(steered):
    with opened(steered) as page:
        says(page, "doing", "walk acts")
        assert told(page, "target_location").startswith("not told yet")
        click_floor(page, 0.4, 0.93)  # before it, since it faces the camera
        says(page, "goals", "m away")
        far, begin = distance(page), frame(page)
        assert 0.5 < far < 30.0
        until_frame(page, begin + 15)
        page.keyboard.press("2")
        says(page, "doing", "walk_aim acts")
        shot(page, "steer_aims")
        until_frame(page, begin + 30)
        page.keyboard.press("1")
        says(page, "doing", "walk acts")
        says(page, "goals", "reached after")
        assert told(page, "target_location").startswith("reached after ")
        shot(page, "steer_reached")
        click_floor(page, 0.5, 0.02)
        says(page, "toast", "That is the sky")


def test_an_arrow_is_dragged_by_its_tip(steered):
    with opened(steered) as page:
        page.keyboard.press("2")
        says(page, "doing", "walk_aim acts")
        assert told(page, "aiming").startswith("not told yet")
        page.keyboard.press("Space")
        begin = frame(page)
        x, y = tip(page)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x - 60, y - 50, steps=4)
        page.mouse.up()
        page.wait_for_timeout(500)
        assert frame(page) <= begin + 2  # paused: the server waits, too
        page.keyboard.press("Space")
        says(page, "goals", "° up")
        shot(page, "steer_arrow")
        slider = page.get_by_label("Aim the right arm: Turn")
        slider.evaluate("e => { e.value = 15; e.dispatchEvent(new Event('input')); }")
        says(page, "goals", "15°, ")
        page.click("#theme")
        until_frame(page, frame(page) + 20)
        shot(page, "steer_dark")


def tip(page: Any) -> tuple[float, float]:
    """Where the hand can take an arrow, in the picture at hand."""
    box = page.locator("#view").bounding_box()
    for row in range(2, 18):
        for column in range(2, 30):
            x = box["x"] + box["width"] * column / 32
            y = box["y"] + box["height"] * row / 20
            page.mouse.move(x, y)
            if page.evaluate("document.getElementById('view').style.cursor") == "grab":
                return x, y
    raise AssertionError("no arrow can be taken")


def test_after_a_fall_it_is_put_back_on_its_feet_with_words(steered):
    with opened(steered, 390, 844) as page:
        for _ in range(2):
            page.click("#push")
        says(page, "doing", "It fell: put back on its feet in ")
        shot(page, "steer_fell_phone")
        says(page, "happened", "It fell: it was put back on its feet · 1 fall so far")
        says(page, "doing", "walk acts")
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= 390
        until_frame(page, frame(page) + 30)
        shot(page, "steer_phone")
        before = frame(page)
        page.click("#restart")
        says(page, "clock", "0.")
        assert frame(page) > before
        assert page.inner_text("#happened") == ""


def test_a_policy_that_was_not_named_is_compiled_when_it_is_chosen(steered):
    with opened(steered) as page:
        page.click("text=wave_squat")
        says(page, "toast", "wave_squat: ")
        begin = frame(page)
        says(page, "doing", "wave_squat acts")
        assert frame(page) > begin + 30  # it walked on meanwhile
        says(page, "goals", "there is nothing to tell it")
        click_floor(page, 0.7, 0.6)
        says(page, "toast", "wave_squat has no goal on the floor")
        shot(page, "steer_wave_squat")


def test_pages_have_a_character_each_and_a_reload_another_one(steered):
    with opened(steered) as page:
        other = page.context.browser.new_page()
        other.goto(steered)
        until_frame(other, 10)
        other.bring_to_front()
        before = other.evaluate("document.body.dataset.frame")
        other.reload()
        other.wait_for_function("() => Number(document.body.dataset.frame) >= 5", timeout=60_000)
        assert other.inner_text("#doing") == "walk acts"
        assert int(before) >= 10
        other.close()
        page.bring_to_front()
        until_frame(page, frame(page) + 10)
