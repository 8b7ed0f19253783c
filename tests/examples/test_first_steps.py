"""The notebook runs from its first to its last cell."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import pytest

NOTEBOOK = Path(__file__).resolve().parents[2] / "examples/first_steps.ipynb"


def run(cell: str, names: dict[str, Any]) -> Any:
    """The value of a cell's last expression, as a notebook shows it."""
    tree = ast.parse(cell)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, NOTEBOOK.name, "exec"), names)
    if last is None:
        return None
    return eval(compile(ast.Expression(last.value), NOTEBOOK.name, "eval"), names)


@pytest.mark.slow
def test_every_cell_of_the_notebook_runs(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    names: dict[str, Any] = {}
    shown = [run("".join(c["source"]), names) for c in cells if c["cell_type"] == "code"]
    assert sum(names["successes"].values()) > 25
    film = shown[-2]._repr_html_()
    assert film.count("data:image/png") == len(names["pictures"]) > 50
    assert names["scores"].success > 0.7
    assert all(not c.get("outputs") for c in cells), "saved without its outputs"
