from __future__ import annotations

import pytest
from tiny_task import tiny_task

from getup_jax.config import PhysicsConfig
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.physics.character import load_character


@pytest.fixture(scope="session")
def built() -> BuiltTask:
    """A get-up task of two styles whose pose prior always gives the neutral pose."""
    return tiny_task(load_character(PhysicsConfig(engine="native")))
