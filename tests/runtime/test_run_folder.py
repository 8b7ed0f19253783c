from __future__ import annotations

import os

import pytest

from getup_jax.config import Config
from getup_jax.runtime.run_folder import CONFIG, RunError, check, prepare


def test_a_folder_is_of_one_training_at_a_time(tmp_path):
    folder, said = tmp_path / "run", []
    with prepare(folder, Config(), False, said.append):
        before = (folder / CONFIG).read_bytes()
        for resume in (False, True):
            with pytest.raises(RunError, match=rf"run: another .* \(process {os.getpid()}\); stop"):
                prepare(folder, Config(seed=3), resume, said.append)
        assert (folder / CONFIG).read_bytes() == before
    check(folder, resume=False)  # settings and the lock alone are nothing to lose
    with prepare(folder, Config(seed=3), True, said.append):
        assert said == ["resuming with seed = 3 instead of 0"]
