from __future__ import annotations

import importlib
import os
import re
import subprocess
import sys
import tomllib
import types
import warnings
from pathlib import Path
from typing import Any

import pytest

from getup_jax.cli import main as cli
from getup_jax.config import ConfigError, load
from getup_jax.core.resources import config_path

ROOT = Path(__file__).parents[2]


class FakeTrain(types.ModuleType):
    """getup_jax.training.run with a run that only notes its arguments."""

    def __init__(self) -> None:
        super().__init__("getup_jax.training.run")
        self.made: list[tuple[Any, ...]] = []
        self.result: int | None = None

    def run(self, *arguments: Any) -> int | None:
        self.made.append(arguments)
        return self.result


@pytest.fixture
def calls(tmp_path, monkeypatch) -> FakeTrain:
    """The calls of `train.run`, from an empty folder."""
    module = FakeTrain()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "getup_jax.training.run", module)
    return module


def test_train_gets_settings_and_the_default_run_folder(calls, capsys):
    assert cli.train_main(["configs/quick.yaml", "seed=4"]) == 0
    expected = load.load_config("quick", ["seed=4"])
    assert calls.made == [(expected, Path("runs/quick"), False, False)]
    assert "configs/quick.yaml into runs/quick" in capsys.readouterr().out


def test_train_takes_options_between_overrides(calls, capsys):
    arguments = ["quick", "seed=4", "--run", "mine", "--resume", "ppo.epochs=2", "--quiet"]
    assert cli.train_main(arguments) == 0
    ((config, *rest),) = calls.made
    assert (config.seed, config.ppo.epochs, rest) == (4, 2, [Path("mine"), True, True])
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(("number", "code"), [(None, 0), (1, 129), (2, 130), (15, 143)])
def test_the_exit_code_tells_of_a_signal(calls, number, code):
    calls.result = number
    assert cli.train_main(["quick"]) == code


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["quick", "ppo.learnig_rate=1"],
            "ConfigError: ppo.learnig_rate: unknown key; did you mean",
        ),
        (["nothing.yaml"], "ConfigError: nothing.yaml: no such config file; the shipped configs"),
        (["full"], "ConfigError: full: is a folder; expected a YAML file, or a shipped config's"),
        (["quick", "--run", "full"], "RunError: full: holds a run already; add --resume"),
        (["quick", "--run", "full/file"], "RunError: full/file: is a file"),
    ],
)
def test_errors_of_users_are_one_clean_line(calls, capsys, arguments, message):
    Path("full").mkdir()
    Path("full/file").write_text("")
    assert cli.train_main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith(message)
    assert captured.err.count("\n") == 1
    assert captured.out == ""
    assert calls.made == []


def test_a_full_folder_can_be_resumed(calls):
    Path("runs/quick").mkdir(parents=True)
    Path("runs/quick/config.yaml").write_text("")
    assert cli.train_main(["quick", "--resume"]) == 0


def test_errors_of_ours_keep_their_traceback(calls, monkeypatch):
    def fail(*_):
        raise ValueError("a shape does not fit")

    monkeypatch.setattr(calls, "run", fail)
    with pytest.raises(ValueError, match="a shape"):
        cli.train_main(["quick"])


def test_warnings_are_one_clean_line(calls, capsys, monkeypatch):
    def warn(*_):
        warnings.warn("going back to 00000003", RuntimeWarning, stacklevel=2)

    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    monkeypatch.setattr(calls, "run", warn)
    assert cli.train_main(["quick"]) == 0
    # pytest records warnings itself, so the printer is called as Python would.
    warnings.showwarning("going back to 00000003", RuntimeWarning, "file.py", 3)
    assert "warning: going back to 00000003\n" in capsys.readouterr().err


EARLY = """
import sys
from getup_jax.cli.main import eval_main, train_main
code = train_main(["quick", "ppo.learnig_rate=1"])
try:
    eval_main(["--start-noise", "-1"])
except SystemExit as error:
    code = max(code, error.code)
heavy = {"jax", "flax", "orbax", "mujoco", "numpy"} & set(sys.modules)
sys.exit(code if not heavy else f"imported {heavy}")
"""


def test_a_wrong_setting_is_answered_before_anything_heavy_is_imported():
    done = subprocess.run(
        [sys.executable, "-c", EARLY], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr


def test_eval_passes_its_arguments_on(monkeypatch):
    seen = []
    module = types.SimpleNamespace(evaluate_command=seen.append)
    monkeypatch.setitem(sys.modules, "getup_jax.cli.evaluate", module)
    assert cli.eval_main([]) == 0
    options = ["--ckpt", "runs/a", "--episodes", "7", "--seed", "3", "--json", "a.json"]
    assert cli.eval_main([*options, "--video", "a.mp4", "--engine", "mjx"]) == 0
    default = {"ckpt": "getup", "episodes": None, "seed": 0, "start": "lying"}
    default |= {"start_noise": 0.0, "duration_scale": (1.0, 1.0)}
    default |= dict.fromkeys(
        [
            "json",
            "video",
            "turntable",
            "glb",
            "usd",
            "plot",
            "engine",
            "stand_time",
            "blend",
            "push",
            "edits",
            "curves",
        ]
    )
    default |= {"size": (720, 1280)}
    default |= {"terrain_seed": None, "motions": None, "script": None, "drops": None}
    default |= {"ground": None}
    assert vars(seen[0]) == default
    assert vars(seen[1]) == default | {
        "ckpt": "runs/a",
        "episodes": 7,
        "seed": 3,
        "json": Path("a.json"),
        "video": Path("a.mp4"),
        "engine": "mjx",
    }


def test_pictures_need_no_display(monkeypatch):
    # MuJoCo reads the variable when it is imported, so the command has to set it before
    monkeypatch.setattr(os, "environ", {})
    module = types.SimpleNamespace(evaluate_command=lambda _: None)
    monkeypatch.setitem(sys.modules, "getup_jax.cli.evaluate", module)
    monkeypatch.setattr(sys, "platform", "linux")
    cli.eval_main([])
    assert os.environ == {}
    cli.eval_main(["--plot", "a.png"])
    assert os.environ == {"MUJOCO_GL": "egl"}


def test_a_display_or_a_chosen_renderer_is_kept(monkeypatch):
    module = types.SimpleNamespace(evaluate_command=lambda _: None)
    monkeypatch.setitem(sys.modules, "getup_jax.cli.evaluate", module)
    for given in ({"DISPLAY": ":0"}, {"MUJOCO_GL": "osmesa"}):
        monkeypatch.setattr(os, "environ", dict(given))
        cli.eval_main(["--video", "a.mp4"])
        assert os.environ == given


def test_eval_errors_are_clean(monkeypatch, capsys):
    def fail(_):
        raise ConfigError("physics.engine: expected one of ...")

    module = types.SimpleNamespace(evaluate_command=fail)
    monkeypatch.setitem(sys.modules, "getup_jax.cli.evaluate", module)
    assert cli.eval_main([]) == 2
    assert capsys.readouterr().err == "ConfigError: physics.engine: expected one of ...\n"


@pytest.mark.parametrize("number", ["0", "-3", "x"])
def test_eval_wants_at_least_one_episode(number, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.eval_main(["--episodes", number])
    assert caught.value.code == 2
    assert "--episodes" in capsys.readouterr().err


def test_motion_passes_its_arguments_on(monkeypatch):
    seen = []
    module = types.SimpleNamespace(main=seen.append)
    monkeypatch.setitem(sys.modules, "getup_jax.cli.motion", module)
    assert cli.motion_main(["list", "x"]) == 0
    assert seen == [["list", "x"]]


def test_export_passes_its_arguments_on(monkeypatch):
    seen = []
    module = types.SimpleNamespace(main=lambda argv: seen.append(argv) or 0)
    monkeypatch.setitem(sys.modules, "getup_jax.release.export", module)
    assert cli.export_main(["runs/flat", "out"]) == 0
    assert seen == [["runs/flat", "out"]]


def test_every_script_of_the_package_is_there():
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    assert {"getup-train", "getup-eval", "getup-export", "getup-motion"} <= scripts.keys()
    for place in scripts.values():
        module, _, name = place.partition(":")
        assert callable(getattr(importlib.import_module(module), name))


def test_nothing_tells_to_import_from_the_folder_that_one_stands_in():
    # `python -m` puts that folder first; the commands, `python -P` and `python FILE` do not
    told = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "src").rglob("*.py")]
    unsafe = re.compile(r"python3? -m getup_jax|executable, \"-[mc]\"")
    found = [str(file) for file in told if unsafe.search(file.read_text(encoding="utf-8"))]
    assert found == []


@pytest.mark.parametrize("main", [cli.train_main, cli.eval_main])
def test_help_shows_examples(main, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--help"])
    assert caught.value.code == 0
    assert "examples:" in capsys.readouterr().out


def test_the_help_names_a_config_that_exists(capsys):
    with pytest.raises(SystemExit):
        cli.train_main(["--help"])
    assert "getup-train configs/flat.yaml" in capsys.readouterr().out
    assert config_path("configs/flat.yaml").is_file()
