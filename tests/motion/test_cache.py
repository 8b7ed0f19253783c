from __future__ import annotations

from pathlib import Path

from getup_jax.cli.motion import main

# of Python, of ours, and of what ours imports
SHADOWED = ("numpy", "scipy", "yaml", "mujoco", "pickle", "json", "getup_jax")


def test_workers_import_nothing_from_the_folder_that_one_stands_in(tmp_path, monkeypatch, capsys):
    for name in SHADOWED:
        Path(tmp_path, f"{name}.py").write_text(f"open('{name}_was_run', 'w')\n")
    for name in ("a", "b"):  # of one file alone there is no worker
        Path(tmp_path, f"{name}.bvh").write_text("HIERARCHY\nROOT a\n{\n")
    monkeypatch.chdir(tmp_path)
    assert main(["import", "."]) == 1
    said = capsys.readouterr().out
    assert "error: a.bvh: " in said
    assert "error: b.bvh: " in said
    assert not list(tmp_path.glob("*_was_run"))
