from __future__ import annotations

import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.physics.character import CharacterSpec, load_character


@pytest.fixture(scope="session")
def character() -> CharacterSpec:
    """The shipped character with the default settings; not to be changed."""
    return load_character(PhysicsConfig())
