"""The editor in a browser that keeps nothing, has no room left, or cannot read what it kept."""

from __future__ import annotations

import pytest
from browser import BROWSER, HEIGHT, drag, edited, judged, new_project, opened, says, value

pytestmark = BROWSER

_FORBIDDEN = """
for (const name of ["localStorage", "sessionStorage"]) {
  Object.defineProperty(window, name, { get() { throw new DOMException("denied"); } });
}
IDBFactory.prototype.open = () => { throw new DOMException("denied"); };
"""
_UNREADABLE = """
for (const name of ["get", "getAll"]) {
  IDBObjectStore.prototype[name] = () => { throw new DOMException("broken"); };
}
"""
_COUNTED = """
window.kept = 0;
StorageManager.prototype.persist = async () => { window.kept += 1; throw new DOMException("no"); };
"""
_FULL = """
window.put = IDBObjectStore.prototype.put;
window.fill = () => { IDBObjectStore.prototype.put = () => { throw new DOMException("full"); }; };
window.empty = () => { IDBObjectStore.prototype.put = window.put; };
"""


@pytest.mark.parametrize(
    ("script", "words"), [(_FORBIDDEN, "keeps nothing"), (_UNREADABLE, "(broken); export it")]
)
def test_a_browser_that_keeps_nothing_edits_all_the_same(page_server, script, words):
    with opened(page_server[0], script=script) as page:
        says(page, "toast", words)
        edited(page, lambda: drag(page, HEIGHT, 4, 30))
        assert judged(page)
        before = page.evaluate("document.documentElement.dataset.theme")
        page.click("#theme")
        assert page.evaluate("document.documentElement.dataset.theme") != before
        page.click("#project")
        with page.expect_download():
            page.click("#project-export")


def test_a_browser_is_asked_once_to_forget_no_project(page_server):
    with opened(page_server[0], script=_COUNTED) as page:
        assert page.evaluate("kept") == 0
        for pixels in (30, -30):
            edited(page, lambda up=pixels: drag(page, HEIGHT, 4, up))
            page.wait_for_timeout(300)
            page.wait_for_selector("body[data-saved]")
        assert page.evaluate("kept") == 1


def test_a_project_that_is_not_stored_is_not_left_without_a_word(page_server):
    with opened(page_server[0], script=_FULL) as page:
        page.evaluate("fill()")
        edited(page, lambda: drag(page, HEIGHT, 4, 30))
        mine = value(page, HEIGHT, 4)
        says(page, "toast", "did not store the project (full)")
        new_project(page)
        says(page, "toast", "is not stored: export it first")
        assert page.inner_text("#project") == "My get-up"
        assert value(page, HEIGHT, 4) == mine
        page.evaluate("empty()")
        page.click("#project-new")
        says(page, "project", "My get-up 2")
        page.click("#project")
        page.click("#project-list li:has-text('My get-up') .wide[aria-current=false]")
        page.wait_for_function("() => !document.getElementById('dialog').open")
        assert value(page, HEIGHT, 4) == mine
