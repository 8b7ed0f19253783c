from __future__ import annotations

import pytest
from ground_samples import make_site
from tiny_task import tiny_task

from getup_jax.config import PhysicsConfig
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.envs.getup.resets.region_pool import Site
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.native import NativeEngine

PHYSICS = PhysicsConfig(engine="native")


@pytest.fixture(scope="session")
def character() -> CharacterSpec:
    return load_character(PHYSICS)


@pytest.fixture(scope="session")
def engine(character) -> NativeEngine:
    return NativeEngine(character, PHYSICS)


@pytest.fixture(scope="session")
def built(character) -> BuiltTask:
    """A get-up task of two styles whose pose prior always gives the neutral pose."""
    return tiny_task(character)


@pytest.fixture(scope="session")
def site() -> Site:
    """A small irregular ground and the character on it."""
    return make_site(PHYSICS)
