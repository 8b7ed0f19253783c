"""The wheel carries configs and assets, and finds them without a checkout around it."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

CHECK = """
import pathlib, sys
import getup_jax
from getup_jax.core.resources import asset_path, config_path, shipped_configs
from getup_jax.config.load import load_config
site = pathlib.Path(sys.argv[1])
for path in (pathlib.Path(getup_jax.__file__), asset_path(), config_path("flat")):
    assert path.is_relative_to(site) and path.exists(), path
assert {"flat", "paper_flat", "quick"} <= set(shipped_configs())
assert load_config("configs/quick.yaml") == load_config("quick")
"""


def test_an_installed_wheel_finds_its_files(tmp_path):
    if importlib.util.find_spec("hatchling") is None:
        pytest.skip("needs hatchling, which is in the extra `dev`")
    wheel = [sys.executable, "-m", "pip", "wheel", "--no-build-isolation", "--no-deps", "--quiet"]
    subprocess.run([*wheel, "--wheel-dir", str(tmp_path), str(ROOT)], check=True)
    (built,) = tmp_path.glob("*.whl")
    site = tmp_path / "site"
    with zipfile.ZipFile(built) as archive:
        archive.extractall(site)
    shipped = {p.relative_to(ROOT) for p in (ROOT / "assets").rglob("*") if p.is_file()}
    assert all((site / "getup_jax" / path).is_file() for path in shipped)
    page = ROOT / "src" / "getup_jax" / "editor" / "page"
    served = {p.relative_to(ROOT / "src") for p in page.rglob("*") if p.is_file()}
    assert all((site / path).is_file() for path in served)
    environment = {**os.environ, "PYTHONPATH": str(site)}
    check = [sys.executable, "-c", CHECK, str(site)]
    subprocess.run(check, check=True, env=environment, cwd=tmp_path)
