from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from getup_jax.config import ConfigError, registry
from getup_jax.config.registry import Registry


@dataclasses.dataclass(frozen=True)
class Dist:
    name: str = "their-package"


@dataclasses.dataclass(frozen=True)
class Point:
    """An entry point of an installed package."""

    name: str
    thing: Any
    group: str = "getup_jax.things"
    value: str = "their_package:thing"
    dist: Any = Dist()

    def load(self) -> Any:
        if isinstance(self.thing, Exception):
            raise self.thing
        return self.thing


@pytest.fixture
def installed(monkeypatch):
    """Sets what installed packages have, by group."""

    def install(*points: Point) -> None:
        def found(group: str) -> list[Point]:
            return [point for point in points if point.group == group]

        monkeypatch.setattr(registry, "entry_points", found)

    return install


def test_things_are_found_by_name(installed):
    installed(Point("theirs", 2), Point("other", 3, group="another.group"))
    things = Registry("getup_jax.things", {"own": 1})
    things.register("new", 4)
    assert dict(things) == {"own": 1, "theirs": 2, "new": 4}
    assert things.choose("theirs", "task.things") == 2
    with pytest.raises(ConfigError, match=r"task\.things: unknown .*mean 'theirs'\?"):
        things.choose("their", "task.things")


def test_a_name_means_one_thing(installed):
    installed(Point("own", 2))
    with pytest.raises(ConfigError, match=r"own: is registered in getup_jax\.things already"):
        list(Registry("getup_jax.things", {"own": 1}))
    installed()
    things = Registry("getup_jax.things", {"own": 1})
    things.register("own", 1)
    with pytest.raises(ConfigError, match="own: is registered"):
        things.register("own", 2)


def test_a_package_that_cannot_be_imported_is_named(installed):
    installed(Point("theirs", ImportError("no module of theirs")))
    with pytest.raises(ConfigError) as caught:
        _ = Registry("getup_jax.things", {})["theirs"]
    assert str(caught.value) == (
        "getup_jax.things: theirs of their-package cannot be loaded: ImportError: no module of "
        "theirs; mend or uninstall it"
    )


def test_a_package_that_cannot_be_imported_hides_no_other(installed):
    installed(Point("theirs", ImportError("no module of theirs")), Point("other", 3))
    things = Registry("getup_jax.things", {})
    for _ in range(2):
        with pytest.raises(ConfigError, match="theirs of their-package cannot be loaded"):
            list(things)
    installed(Point("other", 3))
    assert dict(things) == {"other": 3}
