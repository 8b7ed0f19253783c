from __future__ import annotations

import sys
from pathlib import Path

import pytest

from getup_jax.core import resources


def test_configs_and_assets_are_found_in_a_checkout():
    assert resources.config_path("flat").is_file()
    assert resources.asset_path().is_dir()
    assert resources.asset_path("checkpoints", "flat").parts[-3:] == (
        "assets",
        "checkpoints",
        "flat",
    )


@pytest.mark.parametrize("name", ["flat", "flat.yaml", "configs/flat.yaml", "configs/flat"])
def test_the_forms_of_a_config_name(name):
    assert resources.config_path(name) == resources.config_path("flat")


def test_a_path_elsewhere_is_not_taken_for_a_shipped_config():
    assert not resources.config_path("mine/flat.yaml").exists()


def test_shipped_configs_exist():
    names = resources.shipped_configs()
    assert {"flat", "paper_flat", "quick"} <= set(names)
    assert all(resources.config_path(name).is_file() for name in names)


def test_a_wheel_has_them_inside_the_package(tmp_path):
    package, checkout = tmp_path / "site" / "getup_jax", tmp_path
    (package / "assets").mkdir(parents=True)
    assert resources._root("assets", package, checkout) == package / "assets"
    assert resources._root("configs", package, checkout) == checkout / "configs"


def test_the_cache_folder_can_be_chosen(tmp_path, monkeypatch):
    monkeypatch.setenv("GETUP_JAX_CACHE", str(tmp_path / "a" / "b"))
    assert resources.cache_dir() == tmp_path / "a" / "b"
    assert resources.cache_dir().is_dir()


@pytest.mark.parametrize(
    ("platform", "variable", "expected"),
    [
        ("linux", None, ".cache/getup_jax"),
        ("linux", "XDG_CACHE_HOME", "chosen/getup_jax"),
        ("darwin", None, "Library/Caches/getup_jax"),
        ("win32", "LOCALAPPDATA", "chosen/getup_jax"),
    ],
)
def test_the_cache_folder_of_each_platform(tmp_path, monkeypatch, platform, variable, expected):
    for name in ("GETUP_JAX_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    if variable is not None:
        monkeypatch.setenv(variable, str(tmp_path / "chosen"))
    assert resources.cache_dir() == tmp_path / expected


def test_a_cache_folder_that_cannot_be_made_says_what_to_do(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("GETUP_JAX_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.raises(OSError, match=r"cannot create.*set GETUP_JAX_CACHE"):
        resources.cache_dir()
