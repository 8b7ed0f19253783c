from __future__ import annotations

import pytest

from getup_jax.config import ConfigError
from getup_jax.config.load import load_config
from getup_jax.envs.getup.build import build_task


def test_a_prior_without_poses_is_an_error_that_names_the_setting():
    config = load_config(None, ["motion.augment_poses=1", "physics.engine=native"])
    with pytest.raises(ConfigError, match=r"motion\.augment_poses: expected at least 4 .* got 2;"):
        build_task(config, lambda text: None)
