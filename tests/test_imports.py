"""Imports flow one way: a module may import its own layer and those to the left of it."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

import getup_jax

PACKAGE = Path(getup_jax.__file__).parent

# From left to right; a name is a sub-package of getup_jax, or a file of it.
LAYERS = [
    ["core"],
    ["config"],
    ["runtime", "networks", "physics"],
    ["motion"],
    ["pose_prior", "rl"],
    ["envs"],
    ["imitation"],
    ["training"],
    ["evaluation"],
    ["functional.py"],
    ["release", "trajectory_search", "editor", "api.py"],
    ["gym"],
    ["cli"],
]
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}


def modules() -> list[Path]:
    return [path for path in sorted(PACKAGE.rglob("*.py")) if path != PACKAGE / "__init__.py"]


def part_of(path: Path) -> str:
    """The layer name of a file: its sub-package."""
    return path.relative_to(PACKAGE).parts[0]


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
    files = {part: f"{part}.py" for part in parts if (PACKAGE / f"{part}.py").exists()}
    return {files.get(part, part) for part in parts} - {"__version__"}


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("import getup_jax.rl.gae", {"getup_jax.rl.gae"}),
        ("from getup_jax import core as c", {"getup_jax.core"}),
        ("def f():\n    from getup_jax.envs.getup import task", {"getup_jax.envs.getup.task"}),
        ("from . import a", {"getup_jax.rl.a"}),
        ("from ..envs import b", {"getup_jax.envs.b"}),
    ],
)
def test_the_reader_of_imports(source, expected):
    assert imported(source, "getup_jax.rl") == expected


def test_every_module_has_a_layer():
    missing = {part_of(path) for path in modules()} - RANK.keys()
    assert not missing, f"add {sorted(missing)} to LAYERS"


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_flow_one_way(path):
    rank = RANK.get(part_of(path), len(LAYERS))
    wrong = {part for part in own_parts(path) if RANK.get(part, len(LAYERS)) > rank}
    assert not wrong, f"{path.relative_to(PACKAGE)} imports {sorted(wrong)} of a layer to its right"


def test_the_learner_knows_no_task():
    files = [path for path in modules() if part_of(path) == "rl"]
    parts = {part for path in files for part in own_parts(path)}
    assert parts <= {"core", "config", "networks", "rl"}


@pytest.mark.parametrize(
    "name",
    [
        *("config", "core/resources.py", "runtime/run_folder.py"),
        *("cli/main.py", "evaluation/options.py", "editor/options.py"),
    ],
)
def test_what_answers_at_once_imports_nothing_heavy(name):
    files = [path for path in modules() if path.is_relative_to(PACKAGE / name)]
    assert files
    names = {n for path in files for n in imported(path.read_text(encoding="utf-8"), "getup_jax")}
    outside = {name.split(".")[0] for name in names} - set(sys.stdlib_module_names)
    assert outside <= {"getup_jax", "yaml"}
