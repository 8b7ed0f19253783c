from __future__ import annotations

import pytest

import throughput
from getup_jax.config import Config, MotionConfig, PriorConfig
from getup_jax.core.resources import shipped_configs
from support.setting import LEAST_STARTS, QUICK_DROPS, make_config


def made(monkeypatch, *words: str) -> tuple[Config, list[str]]:
    said: list[str] = []
    monkeypatch.setattr("sys.argv", ["throughput.py", *words])
    return make_config(throughput.parse_args(), said.append), said


@pytest.mark.parametrize("name", shipped_configs())
def test_every_shipped_config_is_made_in_any_size(monkeypatch, name):
    for words in (["--quick"], ["--num-envs", "24", "--num-steps", "6"], ["--num-envs", "1"]):
        config, _ = made(monkeypatch, "--config", name, *words)
        batch = config.ppo.num_envs * config.ppo.num_steps
        assert batch % config.ppo.minibatch_size == 0
        assert config.task.pool_size <= max(config.ppo.num_envs, LEAST_STARTS)
    config, _ = made(monkeypatch, "--config", name, "--quick")
    assert (config.ppo.num_envs, config.ppo.num_steps) == (8, 4)
    assert config.task.limp_drops == QUICK_DROPS
    assert config.terrain is None or config.terrain.drops == QUICK_DROPS


def test_without_options_the_batch_is_the_configs_and_a_round_is_short(monkeypatch):
    config, said = made(monkeypatch, "ppo.num_envs=96", "task.limp_share=0.25")
    assert (config.ppo.num_envs, config.ppo.num_steps, config.task.limp_share) == (96, 8, 0.25)
    assert said == []


def test_recordings_that_are_not_here_have_a_stand_in_that_is_named(monkeypatch, tmp_path):
    config, said = made(monkeypatch, "--config", "flat_lafan1")
    assert config.motion == MotionConfig()
    assert config.prior == PriorConfig()
    assert said == ["motion.source: no lafan1 here; the authored motions stand in for it"]
    config, said = made(monkeypatch, f"motion.source=[authored,{tmp_path}]")
    assert config.motion.source == ("authored", str(tmp_path))
    assert said == []


def test_another_engine_has_a_solver_of_its_own(monkeypatch):
    config, _ = made(monkeypatch, "physics.solver=pgs", "--engine", "mjx")
    assert (config.physics.engine, config.physics.solver) == ("mjx", "auto")


@pytest.mark.parametrize(
    "words",
    [
        *(["--num-envs", n] for n in ("0", "-1", "1.5", "x", "9" * 5000, "1e3", "")),
        *(["--num-steps", n] for n in ("0", "nan")),
        *(["--seconds", n] for n in ("-1", "nan", "inf", "x")),
        *(["--warm-up", n] for n in ("-1", "nan", "1e9")),
    ],
)
def test_bad_sizes_are_refused(monkeypatch, capsys, words):
    with pytest.raises(SystemExit) as caught:
        made(monkeypatch, *words)
    assert caught.value.code == 2
    assert f"argument {words[0]}: expected" in capsys.readouterr().err
