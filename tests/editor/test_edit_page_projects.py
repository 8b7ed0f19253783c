"""Projects in the browser's lasting storage, in headless Chromium."""

from __future__ import annotations

import re

import pytest
from browser import (
    BROWSER,
    HEIGHT,
    achieved,
    drag,
    edited,
    new_project,
    opened,
    saved,
    says,
    served,
    shot,
    shown,
    value,
)

pytestmark = BROWSER


def kept(page) -> None:
    """Until the last edit is stored."""
    page.wait_for_timeout(300)
    page.wait_for_selector("body[data-saved]")


def test_a_project_survives_the_browser_and_the_server(tmp_path):
    pytest.importorskip("playwright", reason="needs pip install 'getup-jax[browser]'")
    profile = tmp_path / "profile"
    with served("--port", "0") as (address, _), opened(address, profile) as page:
        edited(page, lambda: drag(page, HEIGHT, 4, 40))
        edited(page, lambda: page.click("text=+ variant"))
        edited(page, lambda: drag(page, HEIGHT, 6, -20))
        found, line = (value(page, HEIGHT, 4), value(page, HEIGHT, 6)), achieved(page)
        page.click("#project")
        page.fill("#project-name", "Tom's, rise/1")
        page.press("#project-name", "Enter")
        kept(page)
    port = re.search(r":(\d+)", address)[1]
    with served("--port", port) as (address, _), opened(address, profile) as page:
        page.wait_for_function(
            "() => document.getElementById('project').textContent.includes('Tom')"
        )
        assert page.locator("[role=tab]").count() == 2
        assert (value(page, HEIGHT, 4), value(page, HEIGHT, 6)) == found
        page.wait_for_function(
            "() => !document.getElementById('verdict').textContent.includes('…')"
        )
        assert achieved(page) == line
        edited(page, lambda: page.keyboard.press("Control+z"))
        assert value(page, HEIGHT, 6) != found[1]


def test_projects_are_made_exported_imported_and_removed(page_server, tmp_path):
    with opened(page_server[0], accept_downloads=True) as page:
        edited(page, lambda: drag(page, HEIGHT, 4, 40))
        found = value(page, HEIGHT, 4)
        page.click("#project")
        file = saved(page, "#project-export", tmp_path)
        assert file.name == "My get-up.getup.json"
        edited(page, lambda: page.click("#project-new"))
        assert value(page, HEIGHT, 4) != found
        edited(page, lambda: page.set_input_files("#file-project", str(file)))
        assert value(page, HEIGHT, 4) == found
        page.keyboard.press("Control+z")
        assert value(page, HEIGHT, 4) != found
        page.click("#project")
        page.wait_for_selector("#project-list li >> nth=2")
        assert page.locator("#project-list li").count() == 3
        page.locator('#project-list button[title="Remove"]:not([disabled])').first.click()
        page.wait_for_function("() => document.querySelectorAll('#project-list li').length === 2")
        assert page.locator("#removed-list li").count() == 1
        page.click("#toast button")
        page.wait_for_selector("#removed-list", state="detached")
        assert page.locator("#project-list li").count() == 3
        bad = tmp_path / "bad.getup.json"
        bad.write_text('{"format": 1}')
        page.set_input_files("#file-project", str(bad))
        page.wait_for_selector("#toast.bad")
        assert "bad.getup.json: variants: expected a list" in page.inner_text("#toast")


def test_two_tabs_of_one_project_lose_nothing(page_server):
    with opened(page_server[0]) as page:
        kept(page)
        other = page.context.new_page()
        other.goto(page_server[0])
        other.wait_for_selector("body[data-shown]", timeout=60_000)
        edited(page, lambda: drag(page, HEIGHT, 4, 40))
        kept(page)
        edited(other, lambda: drag(other, HEIGHT, 4, -40))
        other.wait_for_function(
            "() => document.getElementById('project').textContent.includes('copy')"
        )
        here, there = value(page, HEIGHT, 4), value(other, HEIGHT, 4)
        kept(other)
        for tab, found in ((page, here), (other, there)):
            tab.reload()
            tab.wait_for_selector("body[data-shown]", timeout=60_000)
            assert value(tab, HEIGHT, 4) == found
            assert int(shown(tab)) > 0


def test_what_was_removed_outlives_its_notice_and_the_page(page_server):
    def again() -> None:
        kept(page)
        page.reload()
        page.wait_for_selector("body[data-shown]", timeout=60_000)

    with opened(page_server[0]) as page:
        edited(page, lambda: page.click("text=+ variant"))
        edited(page, lambda: drag(page, HEIGHT, 4, 40))
        found = value(page, HEIGHT, 4)
        page.click('[aria-label="Remove this variant"]')
        again()
        shot(page, "removed")
        assert page.locator("#dot").bounding_box()["x"] < 1280, "the list has no room"
        page.select_option("#removed", index=1)
        page.wait_for_function("() => document.querySelectorAll('[role=tab]').length === 2")
        assert value(page, HEIGHT, 4) == found
        assert page.locator("#removed").count() == 0
        page.click('[aria-label="Remove this variant"]')
        page.keyboard.press("Control+z")
        assert value(page, HEIGHT, 4) == found
        new_project(page)
        says(page, "project", "My get-up 2")
        page.click("#project")
        page.click('#project-list button[title="Remove"]:not([disabled])')
        page.wait_for_selector("#removed-list")
        page.click("text=Close")
        again()
        page.click("#project")
        page.click("#removed-list button")
        page.wait_for_selector("#removed-list", state="detached")
        assert page.locator("#project-list li").count() == 2
        page.click('#project-list button[title="Remove"]:not([disabled])')
        page.click("#removed-forget")
        page.click("#toast button")
        page.wait_for_selector("#removed-list", state="detached")
        assert page.locator("#project-list li").count() == 1
