"""Things of users by name: registered in Python, or by an installed package's entry points.

A package that says in its pyproject.toml

    [project.entry-points."getup_jax.goals"]
    follow_me = "my_package.goals:FollowMe"

is known to every command as soon as it is installed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.metadata import entry_points
from typing import Any, TypeVar

from getup_jax.config.check import ConfigError, did_you_mean

T = TypeVar("T")


class Registry(Mapping[str, T]):
    """Named things of one kind; entry points of the group are looked up at the first use."""

    def __init__(self, group: str, own: Mapping[str, T]) -> None:
        self._group, self._found, self._looked = group, dict(own), False

    def register(self, name: str, thing: T) -> None:
        """Add one; ConfigError where the name is taken by another.

        The same definition again, as of a notebook's cell that is run twice, takes its own place.
        """
        known = self._all().get(name, thing)
        if known is not thing and _definition(known) != _definition(thing):
            raise ConfigError(
                f"{name}: is registered in {self._group} already, by {_definition(known)}; choose "
                "another name"
            )
        self._found[name] = thing

    def choose(self, name: str, key: str) -> T:
        """The one of that name; ConfigError of the setting `key` with the names that there are."""
        try:
            check_name(name, tuple(self), key)
        except ConfigError as error:
            hint = f"your own: an installed package with the entry point {self._group}"
            raise ConfigError(f"{error}; {hint}, or registered in Python before") from None
        return self[name]

    def __getitem__(self, name: str) -> T:
        return self._all()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def _all(self) -> dict[str, T]:
        if not self._looked:
            self._looked = True  # before: register comes back here
            try:
                for point in entry_points(group=self._group):
                    self.register(point.name, _loaded(point))
            except ConfigError:
                self._looked = False  # said again the next time, rather than half of them known
                raise
        return self._found


def _definition(thing: Any) -> str:
    """Module and name of what was registered; its text where it has none."""
    module, name = (getattr(thing, word, None) for word in ("__module__", "__qualname__"))
    return f"{module}.{name}" if module and name else repr(thing)


def _loaded(point: Any) -> Any:
    """What an entry point names; ConfigError that names the package where it cannot be had."""
    try:
        return point.load()
    except Exception as error:  # whatever somebody's package does while it is imported
        package = point.dist.name if point.dist else point.value
        raise ConfigError(
            f"{point.group}: {point.name} of {package} cannot be loaded: "
            f"{type(error).__name__}: {error}; mend or uninstall it"
        ) from error


def check_name(name: str, known: tuple[str, ...], key: str) -> None:
    """Raises ConfigError with a suggestion where a name is not known."""
    if name not in known:
        hint = did_you_mean(name, known, "; ")
        raise ConfigError(f"{key}: unknown {name!r}{hint}; known: {', '.join(known) or 'none'}")
