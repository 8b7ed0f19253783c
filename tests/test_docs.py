"""What the documents point to is there, and they stay short."""

from __future__ import annotations

import re
from pathlib import Path

import make_settings
import pytest

import getup_jax as gj
from getup_jax.motion.io.curve_file import KEYS, OPTIONAL, parse_text

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TODAY = [file for file in DOCUMENTS if file.parent.name != "lab"]  # no history
LINK = re.compile(r"\]\((?P<inline>[^)\s]+)\)|^\[\w+\]: (?P<named>\S+)", re.MULTILINE)


def headings(text: str) -> set[str]:
    """The anchors of a document's headings, as GitHub makes them."""
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("file", DOCUMENTS, ids=lambda f: str(f.relative_to(ROOT)))
def test_every_link_leads_somewhere(file):
    for match in LINK.finditer(file.read_text(encoding="utf-8")):
        target = match["inline"] or match["named"]
        if target.startswith(("http://", "https://", "mailto:")):
            continue
        path, _, anchor = target.partition("#")
        found = file if not path else file.parent / path
        assert found.exists(), target
        if anchor:
            assert anchor in headings(found.read_text(encoding="utf-8")), target


@pytest.mark.parametrize(("name", "most"), [("README.md", 150), ("docs/results.md", 200)])
def test_what_is_read_first_is_short(name, most):
    lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
    assert len(lines) <= most
    if name == "README.md":
        assert [line for line in lines if len(line) > 120] == []


def modules(text: str) -> list[str]:
    """Files and folders of code that a text names in code spans."""
    return re.findall(r"`((?:\w+/)+(?:\w+\.py)?|(?:\w+/)*\w+\.py)`", text)


@pytest.mark.parametrize("file", TODAY, ids=lambda f: str(f.relative_to(ROOT)))
def test_the_modules_that_a_document_names_are_there(file):
    source = ROOT / "src/getup_jax"
    named = modules(file.read_text(encoding="utf-8"))
    there = {f.name for f in source.rglob("*.py")}  # a page about one folder leaves that out
    assert [
        n for n in named if not (source / n).exists() | (ROOT / n).exists() | (n in there)
    ] == []


def test_where_to_change_what_is_a_table_of_modules():
    text = (ROOT / "docs/design.md").read_text(encoding="utf-8")
    table = text.split("## Where to change what")[1].split("\n## ")[0]
    assert len(modules(table)) > 30


def test_the_curve_file_to_copy_is_one():
    text = (ROOT / "docs/curve_files.md").read_text(encoding="utf-8")
    example = text.split("An example to copy")[1].split("\n| key |")[0]
    lines = [line[4:] for line in example.splitlines() if line.startswith("    ")]
    curve = parse_text("\n".join(lines), "example")
    assert re.findall(r"^\| `(\w+)`", text, re.MULTILINE) == [*KEYS, *OPTIONAL]
    assert curve.getups()[0].duration == 2.5


def test_the_front_door_is_documented():
    text = (ROOT / "docs/python.md").read_text(encoding="utf-8")
    named = set(re.findall(r"gj\.(\w+)", text))
    assert named <= set(gj.__all__)
    assert set(gj.__all__) - {"Env", "Policy"} <= named


def test_the_page_of_settings_is_that_of_the_code():
    text = make_settings.text()
    assert text == make_settings.FILE.read_text(encoding="utf-8"), (
        "run python docs/make_settings.py"
    )
    rows = [line for line in text.splitlines() if line.startswith("| `")]
    assert len(rows) > 100
    assert [row for row in rows if row.endswith("|  |")] == [], "settings without a comment"
