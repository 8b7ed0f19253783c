from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import peers
from getup_jax.config.load import load_config
from support import peer_process


def args(*words: str) -> argparse.Namespace:
    old, sys.argv = sys.argv, ["peers.py", *words]
    try:
        return peers.parse_args()
    finally:
        sys.argv = old


def peer(*answers: tuple[int, float, float | None], missing: str | None = None):
    """A peer that has given these samples, seconds and successes."""
    made = object.__new__(peers.Peer)
    made.name, made.ready_s, made.missing = "peer", 10.0, missing
    names = ("samples", "seconds", "success")
    made.iterations = [dict(zip(names, x, strict=True)) for x in answers]
    return made


def test_rates_leave_out_the_first_iteration_and_ratios_are_of_rounds():
    ours = peer((100, 9.0, None), (100, 0.1, None), (100, 0.2, None), (100, 0.1, None))
    other = peer((10, 9.0, None), (10, 1.0, None), (10, 2.0, None), (10, 0.5, None))
    found = peers.report(args(), {"ours": ours, "sb3:2": other, "sb3:4": peer(missing="no sb3")})
    assert found["peers"]["ours"]["samples_per_s"] == pytest.approx(1000)
    assert found["peers"]["sb3:2"]["samples_per_s"] == pytest.approx(10)
    assert found["peers"]["sb3:2"]["ours_by_it"] == pytest.approx(100)  # of 100, 100 and 50
    assert found["peers"]["sb3:4"] == {"missing": "no sb3"}
    assert peers.best_of_processes(found["peers"]) == "sb3:2"
    json.dumps(found)


def test_who_reaches_the_share_stops_and_who_is_late_gives_up(capsys):
    script = {"fast": [0.2, 0.95, 1.0], "slow": [None, 0.1, 0.1]}
    found = {}
    for name, values in script.items():
        one = found[name] = peer()
        left = iter(values)
        one.iterate = lambda one=one, left=left: one.iterations.append(
            {"samples": 10, "seconds": 20.0, "success": next(left)}
        )
    peers.reach(found, 0.9, limit_s=60.0)
    assert [len(x.iterations) for x in found.values()] == [2, 3]
    text = capsys.readouterr().out
    assert "fast: success 95% after 50 s, reached it" in text
    assert "slow: no episode yet after 30 s, goes on" in text
    assert "slow: success 10% after 70 s, gives up" in text
    rows = peers.report(args("--success", "0.9"), found)["peers"]
    assert (rows["fast"]["reached"], rows["slow"]["reached"]) == (True, False)
    assert (rows["fast"]["seconds"], rows["fast"]["samples"]) == (50.0, 20)


LINES = {"lasts": 3, "breaks": 1, "never starts": 0}  # that a process says before it ends


def test_a_peer_that_breaks_is_a_line_and_the_others_go_on(monkeypatch, capsys):
    def started(name: str, setting: dict) -> subprocess.Popen[str]:
        text = json.dumps({"samples": 10, "seconds": 1.0, "success": None})
        script = "".join(f"print({text!r}, flush=True); input();" for _ in range(LINES[name]))
        pipe = subprocess.PIPE
        return subprocess.Popen([sys.executable, "-c", script], stdin=pipe, stdout=pipe, text=True)

    monkeypatch.setattr(peers, "_started", started)
    found = {name: peers.Peer(name, {}) for name in LINES}
    for _ in range(2):
        peers._round(peers._left(found), "round")
    for one in found.values():
        one.close()
    rows = peers.report(args(), found)["peers"]
    assert rows["lasts"]["samples_per_s"] == 10.0
    assert rows["breaks"] == {"missing": "ended with code 0; its message is above"}
    assert rows["never starts"] == rows["breaks"]
    peers.show({"peers": rows})
    assert capsys.readouterr().out.count("ended with code 0") == 4  # when it ends, and in the table


def test_sizes_are_the_configs_but_for_the_length_of_slow_rollouts():
    config = load_config("flat")
    ours = peers.setting_of("ours", args(), config, "")
    assert (ours["num_envs"], ours["num_steps"], ours["minibatch_size"]) == (512, 32, 256)
    slow = peers.setting_of("sb3:8", args(), config, "")
    assert slow["num_envs"] * slow["num_steps"] == 2048
    assert slow["minibatch_size"] == 256
    assert peers.setting_of("sb3:8", args("--success", "0.9"), config, "")["num_envs"] == 512


def test_the_settings_of_stable_baselines_mean_what_the_config_says():
    torch = SimpleNamespace(nn=SimpleNamespace(ReLU="relu"))
    config = load_config("quick")
    found = peer_process.sb3_settings(config, torch)
    assert (found["batch_size"], found["n_epochs"], found["learning_rate"]) == (1024, 6, 3e-4)
    assert found["policy_kwargs"]["net_arch"] == {"pi": [256, 256], "vf": [256, 256]}
    assert found["policy_kwargs"]["log_std_init"] == pytest.approx(-0.5108, abs=1e-3)


@pytest.mark.parametrize("value", ["0", "1.5", "nan", "x"])
def test_a_share_is_above_0_and_at_most_1(value, capsys):
    with pytest.raises(SystemExit):
        args("--success", value)
    assert "expected" in capsys.readouterr().err


def test_a_peer_that_is_not_installed_is_a_line(tmp_path, monkeypatch, capsys):
    """The real process, in which stable-baselines3 cannot be imported."""
    (tmp_path / "stable_baselines3.py").write_text("raise ImportError('not here')\n")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{Path(peers.__file__).parent.parent / 'src'}")
    words = args("--quick", "--peers", "sb3", "--config", "quick")
    one = peers.Peer("sb3", peers.setting_of("sb3", words, load_config("quick"), str(tmp_path)))
    one.close()
    assert one.missing
    peers.show(peers.report(words, {"sb3": one}))
    assert "not installed" in capsys.readouterr().out
