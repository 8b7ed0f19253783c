"""Imports flow one way: a module may import its own layer and those to the left of it."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

import getup_jax

PACKAGE = Path(getup_jax.__file__).parent

# From left to right; a name is a module or a sub-package of getup_jax.
LAYERS = [
    ["types", "config", "rotation", "rows", "mirror"],
    ["convert", "paths", "settings", "yaml_text"],
    ["storage", "manifest", "checkpoint", "metrics", "progress", "journal", "runfolder", "stop"],
    ["physics", "nets", "motion"],
    ["tasks"],
    ["grounds"],
    ["algo"],
    ["lessons"],
    ["footing", "transfer", "rehearsal"],
    ["loop", "train"],
    ["conditions", "naturalness", "episodes", "scores", "score_table", "video", "eval_plot"],
    ["control_gain"],
    ["composite"],
    ["composite_card"],
    ["evaluate", "model_card", "export", "search"],
    ["eval_options"],
    ["cli", "editor"],
]
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}


def modules() -> list[Path]:
    return [path for path in sorted(PACKAGE.rglob("*.py")) if path != PACKAGE / "__init__.py"]


def part_of(path: Path) -> str:
    """The layer name of a file: its sub-package, or its own name at the top."""
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imported(source: str, package: str) -> set[str]:
    """Absolute dotted names that a source imports; `package` is where relative ones start."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join([*parents, node.module or ""]).strip(".") if node.level else node.module
            names |= {f"{base}.{alias.name}" for alias in node.names}
    return names


def own_parts(path: Path) -> set[str]:
    """The layer names that a file of the package imports."""
    package = ".".join(["getup_jax", *path.relative_to(PACKAGE).parts[:-1]])
    names = imported(path.read_text(encoding="utf-8"), package)
    parts = {name.split(".")[1] for name in names if name.startswith("getup_jax.")}
    return parts - {"__version__"}


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("import getup_jax.algo.gae", {"getup_jax.rl.gae"}),
        ("from getup_jax import paths as p", {"getup_jax.core.resources"}),
        ("def f():\n    from getup_jax.tasks import getup", {"getup_jax.envs.getup.task"}),
        ("from . import a", {"getup_jax.nets.a"}),
        ("from ..tasks import b", {"getup_jax.tasks.b"}),
    ],
)
def test_the_reader_of_imports(source, expected):
    assert imported(source, "getup_jax.nets") == expected


def test_every_module_has_a_layer():
    missing = {part_of(path) for path in modules()} - RANK.keys()
    assert not missing, f"add {sorted(missing)} to LAYERS"


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_flow_one_way(path):
    rank = RANK.get(part_of(path), len(LAYERS))
    wrong = {part for part in own_parts(path) if RANK.get(part, len(LAYERS)) > rank}
    assert not wrong, f"{path.relative_to(PACKAGE)} imports {sorted(wrong)} of a layer to its right"


@pytest.mark.parametrize(
    "name",
    ["convert", "settings", "paths", "config", "runfolder", "cli", "eval_options", "yaml_text"],
)
def test_what_answers_at_once_imports_nothing_heavy(name):
    files = [path for path in modules() if part_of(path) == name]
    assert files
    names = {n for path in files for n in imported(path.read_text(encoding="utf-8"), "getup_jax")}
    outside = {name.split(".")[0] for name in names} - set(sys.stdlib_module_names)
    assert outside <= {"getup_jax", "yaml"}
