from __future__ import annotations

from pathlib import Path

import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.physics.character import load_character

MOCAP = Path(__file__).resolve().parents[2].parent / "shared" / "mocap"


@pytest.fixture(scope="session")
def character():
    return load_character(PhysicsConfig())


@pytest.fixture(scope="session")
def mocap():
    """The folder of recordings beside the checkout; they are not part of the repository."""
    if not MOCAP.is_dir():
        pytest.skip(f"no recordings at {MOCAP}")
    return MOCAP


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A cache folder of the test's own."""
    monkeypatch.setenv("GETUP_JAX_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"
