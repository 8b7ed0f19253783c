from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from browser import served
from edit_running import Quick, running
from edit_samples import make_curve, make_simulator, whole_motion

from getup_jax.editor.simulate import Motion, Simulator
from getup_jax.runtime.checkpoint import LoadedPolicy


@pytest.fixture(scope="session")
def tiny(tmp_path_factory) -> tuple[Simulator, LoadedPolicy]:
    return make_simulator(tmp_path_factory.mktemp("editor"))


@pytest.fixture(scope="session")
def simulator(tiny) -> Simulator:
    return tiny[0]


@pytest.fixture(scope="session")
def motion(simulator) -> Motion:
    return whole_motion(simulator, make_curve())


@pytest.fixture(scope="session")
def site(simulator):
    session = Quick(simulator)
    with running(lambda log: (session, {"name": "scene"})) as server:
        yield server.wait(2)


@pytest.fixture(scope="session")
def page_server() -> Iterator[tuple[str, Any]]:
    """A running `getup-edit` with the shipped policy: its address and its process."""
    pytest.importorskip("playwright", reason="needs pip install 'getup-jax[browser]'")
    with served("--port", "0") as running:
        yield running
