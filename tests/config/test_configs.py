from __future__ import annotations

import ast
import dataclasses
import types
import typing
from pathlib import Path

import pytest

import getup_jax
from getup_jax.config import Config
from getup_jax.config.load import load_config
from getup_jax.core.resources import shipped_configs

PACKAGE = Path(getup_jax.__file__).parent


@pytest.mark.parametrize("name", shipped_configs())
def test_every_shipped_config_loads(name):
    assert isinstance(load_config(name), Config)


def test_the_published_settings_are_those_of_the_paper():
    ppo = load_config("paper_flat").ppo
    assert (ppo.num_envs, ppo.num_steps, ppo.minibatch_size, ppo.epochs) == (16, 2048, 256, 10)
    assert (ppo.learning_rate, ppo.action_std, ppo.stages) == ((1e-4, 2e-5), (0.6, 0.3), 5)


def leaves(cls: type, prefix: str = "") -> list[str]:
    """The dotted names of all settings, those of optional and listed sub-configs too."""
    found = []
    for name, hint in typing.get_type_hints(cls).items():
        inner: list[typing.Any] = [part for part in parts(hint) if dataclasses.is_dataclass(part)]
        below = [leaf for part in inner for leaf in leaves(part, f"{prefix}{name}.")]
        found += below or [prefix + name]
    return found


def parts(hint: typing.Any) -> list[typing.Any]:
    """The classes in an annotation: [A] of A, A | None and tuple[A, ...]."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType, tuple):
        return [part for arg in typing.get_args(hint) for part in parts(arg)]
    return [hint]


def names_read(folder: Path) -> set[str]:
    """The attributes that the sources read, `x.name`, outside of the config itself."""
    names = set()
    for path in folder.rglob("*.py"):
        if path.parent == folder / "config":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
                names.add(node.attr)
    return names


def test_the_reader_of_leaves():
    @dataclasses.dataclass
    class Inner:
        x: int = 0

    Outer = dataclasses.make_dataclass(
        "Outer", [("a", Inner | None), ("b", tuple[Inner, ...]), ("c", tuple[float, ...])]
    )
    assert leaves(Outer) == ["a.x", "b.x", "c"]


def test_every_setting_is_read_somewhere():
    read = names_read(PACKAGE)
    unread = [key for key in leaves(Config) if key.rpartition(".")[2] not in read]
    assert not unread, f"no source reads these settings: {', '.join(unread)}"
