"""The tests run on the CPU unless JAX_PLATFORMS says otherwise, and render without a display.

Most of their time is XLA's, which compiles more than twice as fast without optimisations of its
code generator; `XLA_FLAGS= make test` runs what users run.
"""

import contextlib
import importlib
import os
import sys
from collections import Counter
from collections.abc import Iterator

import pytest

os.environ.setdefault("JAX_PLATFORMS", "cpu")
if os.environ["JAX_PLATFORMS"] == "cpu":
    quick = "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false"
    os.environ.setdefault("XLA_FLAGS", quick)
if sys.platform == "linux" and "DISPLAY" not in os.environ:
    os.environ.setdefault("MUJOCO_GL", "egl")


@pytest.hookimpl(trylast=True)  # when -m has taken its share
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files of few tests first: they are the ones that compile for a minute."""
    count = Counter(item.path for item in items)
    items.sort(key=lambda item: count[item.path])


_MANY = 6_000  # memory maps of a process; every compiled program has some


@pytest.fixture(autouse=True, scope="module")
def _forgets() -> Iterator[None]:
    """Compiled programs are dropped after a file where they have become many.

    A process keeps those of all its files otherwise, 5 to 7 GB of them in the end.
    """
    yield
    maps = "/proc/self/maps"
    if os.path.exists(maps) and "jax" in sys.modules:
        with open(maps, encoding="utf-8") as lines:
            many = sum(1 for _ in lines) > _MANY
        if many:
            sys.modules["jax"].clear_caches()


# where torch is installed: before any test renders, see getup_jax/gym/__init__.py
with contextlib.suppress(ImportError):
    importlib.import_module("triton")
