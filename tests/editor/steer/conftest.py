from __future__ import annotations

import pytest

from getup_jax.editor.steer.policies import Policies, choose
from getup_jax.runtime.checkpoint import load_policy
from steering_samples import config_with, save


@pytest.fixture(scope="session")
def policies(tmp_path_factory) -> Policies:
    """Two untrained policies, compiled: one with a place to go to, one that aims as well."""
    base = tmp_path_factory.mktemp("steer")
    walk = str(save(base / "walk", config_with({"target_location": {}})))
    aim = str(save(base / "aim", config_with({"target_location": {}, "aiming": {}})))
    made = choose(walk, load_policy(walk), [aim], None)
    made.build(lambda text: None)
    return made
