from __future__ import annotations

import jax
import jax.numpy as jnp
import pytest
from jax.experimental.compilation_cache import compilation_cache

from getup_jax.editor import compiled


@pytest.fixture
def untouched(monkeypatch, tmp_path):
    names = ("jax_compilation_cache_dir", "jax_persistent_cache_min_compile_time_secs")
    before = {name: getattr(jax.config, name) for name in names}
    monkeypatch.setenv("GETUP_JAX_CACHE", str(tmp_path))
    jax.config.update("jax_compilation_cache_dir", None)
    compilation_cache.reset_cache()
    yield tmp_path
    for name, value in before.items():
        jax.config.update(name, value)
    compilation_cache.reset_cache()


def test_a_program_is_kept_in_the_cache_folder(untouched, monkeypatch):
    monkeypatch.setattr(compiled, "_WORTH_S", 0.0)
    compiled.keep_compiled()
    jax.jit(lambda x: jnp.sin(x) * 1.2345)(jnp.ones(3))
    assert list((untouched / "compiled").glob("jit_*"))


def test_a_folder_that_was_chosen_stays(untouched):
    jax.config.update("jax_compilation_cache_dir", str(untouched / "mine"))
    compiled.keep_compiled()
    assert jax.config.jax_compilation_cache_dir == str(untouched / "mine")


def test_a_folder_that_cannot_be_made_is_said_and_nothing_is_kept(untouched, monkeypatch):
    (untouched / "file").write_text("")
    monkeypatch.setenv("GETUP_JAX_CACHE", str(untouched / "file"))
    with pytest.warns(UserWarning, match="GETUP_JAX_CACHE"):
        compiled.keep_compiled()
    assert jax.config.jax_compilation_cache_dir is None
