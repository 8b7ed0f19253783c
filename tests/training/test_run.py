from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import struct

from getup_jax.config import Config, ConfigError, PhysicsConfig
from getup_jax.config.load import load_config
from getup_jax.physics.body_digest import body_digest
from getup_jax.physics.character import load_character
from getup_jax.runtime import checkpoint, run_folder
from getup_jax.runtime.console import Display
from getup_jax.runtime.metric_file import read_metrics
from getup_jax.runtime.pytree_store import CheckpointError
from getup_jax.training import loop
from getup_jax.training.loop import Job, TrainingError
from getup_jax.training.run import run

PER_ITERATION = 8  # samples of an iteration of `settings()`


@struct.dataclass
class Policy:
    weight: jax.Array


@struct.dataclass
class LearnerState:
    policy: Policy
    count: jax.Array
    critic: jax.Array

    @property
    def averaged_policy(self) -> Policy:
        return self.policy

    @property
    def valuation(self) -> dict:
        return {"critic": self.critic}

    def beginning_with(self, policy: Policy, valuation: dict) -> LearnerState:
        return LearnerState(policy, self.count, valuation["critic"])


@struct.dataclass
class State:
    learner: LearnerState
    environment: jax.Array
    key: jax.Array
    iteration: jax.Array


class ToyLearner:
    """A walk: each iteration depends on the state, the world, the key and its number."""

    def __init__(self, bad_loss_at: int = -1, bad_weight_at: int = -1) -> None:
        self.traces = 0
        self._bad_loss_at, self._bad_weight_at = bad_loss_at, bad_weight_at

    def init(self, world: Any, key: jax.Array) -> State:
        zero = jnp.zeros(())
        learner = LearnerState(Policy(jax.random.normal(key, (2,))), zero.astype(jnp.int32), zero)
        rows = jax.random.bits(key, (3, 2), jnp.uint32)
        return State(learner, rows, jnp.array(key), jnp.zeros((), jnp.int32))

    def iteration(self, world: Any, state: State) -> tuple[State, dict[str, jax.Array]]:
        self.traces += 1
        number = state.iteration + 1
        noise = (state.key * jnp.uint32(2654435761) + number.astype(jnp.uint32)) % 1000
        weight = state.learner.policy.weight * 0.9 + noise.astype(jnp.float32) * world["scale"]
        reward = weight.sum() + (state.environment[0, 0] % 7).astype(jnp.float32)
        weight = jnp.where(number == self._bad_weight_at, jnp.nan, weight)
        metrics = {
            "rollout/reward": reward,
            "episode/success": jnp.where(number % 2 == 0, 1.0, jnp.nan),
            "loss/value": jnp.where(number == self._bad_loss_at, jnp.nan, 1.0),
        }
        old = state.learner
        learner = LearnerState(Policy(weight), old.count + 1, old.critic + 1.0)
        return State(learner, state.environment * 3 + 1, state.key, number), metrics


def builder(learner: ToyLearner | None = None, body: dict[str, str] | None = None):
    def build(config: Config, say) -> Job:
        say("toy task")
        world = {"scale": np.float32(0.001)}
        return Job(learner or ToyLearner(), world, {"decoder": jnp.ones(2)}, body=body)

    return build


def settings(iterations: int, *overrides: str) -> Config:
    sizes = ["ppo.num_envs=4", "ppo.num_steps=2", "ppo.minibatch_size=4", "train.save_every_s=1e9"]
    total = f"train.total_steps={iterations * PER_ITERATION - 3}"
    return load_config(None, [*sizes, total, *overrides])


def train(folder: Path, iterations: int, *overrides: str, resume=False, learner=None, quiet=True):
    return run(settings(iterations, *overrides), folder, resume, quiet, builder(learner))


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory) -> Path:
    """A run of 7 iterations that saved each of them; shorter runs are the start of it."""
    folder = tmp_path_factory.mktemp("unbroken")
    train(folder, 7, "train.save_every_s=0", "train.keep=9")
    return folder


def arrays(folder: Path, iteration: int | None = None) -> dict[str, Any]:
    """The whole state of a checkpoint, by default the run's newest."""
    newest = checkpoint.steps(folder / "checkpoints")[-1]
    step = newest if iteration is None else newest.parent / f"{iteration:08d}"
    return checkpoint.read_item(step / "learner")


def assert_equals_unbroken(folder: Path, unbroken: Path, iterations: int) -> None:
    """History and state of the run are those of the unbroken one, bit by bit."""
    assert history(folder) == history(unbroken)[:iterations]
    jax.tree.map(np.testing.assert_array_equal, arrays(folder), arrays(unbroken, iterations))


def saved(folder: Path) -> list[int]:
    return [int(step.name) for step in checkpoint.steps(folder / "checkpoints")]


def history(folder: Path) -> list[tuple[Any, ...]]:
    """What must be the same in every run of the same settings."""
    keys = ("iteration", "steps", "rollout/reward", "loss/value")
    return [tuple(row[key] for key in keys) for row in read_metrics(folder)]


def test_a_run_from_start_to_end(tmp_path):
    learner = ToyLearner()
    assert train(tmp_path, 5, learner=learner) is None
    assert [row[:2] for row in history(tmp_path)] == [(i, 8 * i) for i in range(1, 6)]
    assert load_config(tmp_path / "config.yaml") == settings(5)
    assert saved(tmp_path) == [5]
    loaded = checkpoint.load_policy(tmp_path)
    assert loaded.metadata == {"iteration": 5, "steps": 40}
    assert loaded.prior["decoder"].tolist() == [1, 1]
    np.testing.assert_array_equal(
        loaded.policy["weight"], arrays(tmp_path)["state"]["learner"]["policy"]["weight"]
    )


def test_a_run_compiles_once(tmp_path):
    learner = ToyLearner()
    train(tmp_path, 3, learner=learner)
    assert learner.traces == 1


def test_a_resumed_run_equals_an_unbroken_one(tmp_path, unbroken):
    learner = ToyLearner()
    train(tmp_path, 3)
    train(tmp_path, 7, resume=True, learner=learner)
    assert_equals_unbroken(tmp_path, unbroken, 7)
    assert learner.traces == 1
    wall = [row["wall_s"] for row in read_metrics(tmp_path)]
    assert wall == sorted(wall)


def test_the_same_seed_gives_the_same_metrics_file(tmp_path):
    for name in ("a", "b"):
        train(tmp_path / name, 3)
    first, second = (tmp_path / name / "metrics.jsonl" for name in ("a", "b"))
    assert first.read_bytes() == second.read_bytes()


def test_a_damaged_newest_checkpoint_costs_only_its_iterations(tmp_path, unbroken):
    train(tmp_path, 4, "train.save_every_s=0")
    (tmp_path / "checkpoints" / "00000004" / "checkpoint.json").write_text("")
    with pytest.warns(RuntimeWarning, match="going back to .*00000003"):
        train(tmp_path, 6, resume=True)
    assert_equals_unbroken(tmp_path, unbroken, 6)


def test_log_every_writes_the_means_of_its_iterations(tmp_path, unbroken):
    train(tmp_path, 5, "train.log_every=2")
    each = [row["rollout/reward"] for row in read_metrics(unbroken)]
    rows = read_metrics(tmp_path)
    assert [row["iteration"] for row in rows] == [2, 4, 5]
    expected = [np.mean(each[0:2]), np.mean(each[2:4]), each[4]]
    np.testing.assert_allclose([row["rollout/reward"] for row in rows], expected, rtol=1e-6)
    assert rows[0]["episode/success"] == 1.0


def test_saves_by_wall_time_and_keeps_as_many_as_set(tmp_path):
    train(tmp_path, 4, "train.save_every_s=0", "train.keep=3")
    assert saved(tmp_path) == [2, 3, 4]


def test_another_seed_is_another_run(tmp_path, unbroken):
    train(tmp_path, 1, "seed=1")
    assert history(tmp_path) != history(unbroken)[:1]


def test_a_run_can_start_from_the_policy_of_another(tmp_path, unbroken):
    train(tmp_path, 1, f"train.init_from={unbroken}")
    assert history(tmp_path) != history(unbroken)[:1]
    # The rest is that of a fresh run: only the policy was taken, and its critic.
    fresh, started = (arrays(folder, 1)["state"] for folder in (unbroken, tmp_path))
    np.testing.assert_array_equal(fresh["environment"], started["environment"])
    np.testing.assert_array_equal(fresh["learner"]["count"], started["learner"]["count"])
    last = arrays(unbroken)["state"]["learner"]["critic"]
    np.testing.assert_array_equal(started["learner"]["critic"], last + 1.0)


def test_a_policy_s_critic_of_another_form_is_left_out(tmp_path, unbroken):
    source = checkpoint.load_policy(unbroken)
    item = {"policy": source.policy, "prior": source.prior, "critic": {"critic": np.zeros(3)}}
    state = {"nothing": np.zeros(1)}
    checkpoint.save_learner(tmp_path / "other", 1, state, source.config, item)
    train(tmp_path / "run", 1, f"train.init_from={tmp_path / 'other'}")
    fresh, started = (arrays(folder, 1)["state"] for folder in (unbroken, tmp_path / "run"))
    np.testing.assert_array_equal(fresh["learner"]["critic"], started["learner"]["critic"])


def test_a_run_can_go_on_with_the_learner_of_another(tmp_path, unbroken):
    train(tmp_path, 1, f"train.init_from={unbroken}", "train.init_learner=true")
    before, after = arrays(unbroken)["state"], arrays(tmp_path, 1)["state"]
    assert int(after["learner"]["count"]) == int(before["learner"]["count"]) + 1
    # counts its own iterations, with its own simulations
    fresh = arrays(unbroken, 1)["state"]
    assert int(after["iteration"]) == 1
    np.testing.assert_array_equal(after["environment"], fresh["environment"])


def test_only_a_run_has_a_learner_to_go_on_with(tmp_path, unbroken):
    exported = checkpoint.export_policy(unbroken, tmp_path / "exported")
    with pytest.raises(CheckpointError, match="exported: has no item 'learner'; give a checkpoint"):
        train(tmp_path / "run", 1, f"train.init_from={exported}", "train.init_learner=true")
    with pytest.raises(ConfigError, match=r"train\.init_learner: expected train\.init_from"):
        train(tmp_path / "run", 1, "train.init_learner=true")


def warnings_in(capsys):
    return [line for line in capsys.readouterr().out.splitlines() if "warning" in line]


def test_a_checkpoint_remembers_the_body_and_a_resumed_run_says_where_it_is_another(
    tmp_path, capsys
):
    body, heavier = {"masses": "a", "servos": "b"}, {"masses": "c", "servos": "b"}
    run(settings(1), tmp_path, quiet=False, build=builder(body=body))
    assert checkpoint.load_policy(tmp_path).metadata["body"] == body
    assert not warnings_in(capsys)
    run(settings(2), tmp_path, True, False, builder(body=heavier))
    (line,) = warnings_in(capsys)
    assert "was trained on a body with other masses; " in line


def test_another_body_than_that_of_the_policy_to_begin_with_is_said_before_building(
    tmp_path, capsys
):
    def unbuilt(config, log):
        raise TrainingError("nothing is built here")

    first = tmp_path / "first"
    run(settings(1), first, build=builder(body=body_digest(load_character(PhysicsConfig()).model)))
    begin = f"train.init_from={first}"
    run(settings(1, begin), tmp_path / "same", build=builder())
    assert not warnings_in(capsys)
    with pytest.raises(TrainingError):
        run(settings(1, begin, "physics.gain_scale=2"), tmp_path / "other", build=unbuilt)
    (line,) = warnings_in(capsys)
    assert "was trained on a body with other servos; " in line
    with pytest.raises(CheckpointError, match="none: no such folder"):
        run(settings(1, f"train.init_from={tmp_path}/none"), tmp_path / "no", build=unbuilt)
    with pytest.raises(ConfigError, match=r"train\.init_from: expected a policy of getting up"):
        run(settings(1, "train.init_from=walk"), tmp_path / "no", build=unbuilt)


# --- the run folder


def test_a_folder_that_holds_something_is_not_overwritten(tmp_path):
    train(tmp_path, 1)
    before = arrays(tmp_path)
    with pytest.raises(run_folder.RunError, match="holds a run already; add --resume"):
        train(tmp_path, 2)
    jax.tree.map(np.testing.assert_array_equal, arrays(tmp_path), before)


def test_a_run_that_failed_before_its_first_iteration_can_be_started_again(tmp_path):
    def fail(*_):
        raise OSError("no motions")

    with pytest.raises(OSError, match="no motions"):
        run(settings(1), tmp_path, quiet=True, build=fail)
    train(tmp_path, 1)


def test_resume_without_a_checkpoint_starts_from_the_beginning(tmp_path, unbroken):
    (tmp_path / "metrics.jsonl").write_text('{"iteration": 1, "steps": 8}\n')
    train(tmp_path, 2, resume=True)
    assert_equals_unbroken(tmp_path, unbroken, 2)


def test_resuming_a_finished_run_does_nothing(unbroken, capsys):
    learner = ToyLearner()
    changed = ("train.save_every_s=0", "train.keep=9")
    assert train(unbroken, 7, *changed, resume=True, learner=learner, quiet=False) is None
    assert learner.traces == 0
    assert "has all of its 56 steps" in capsys.readouterr().out


def test_resuming_names_the_settings_that_changed(tmp_path, capsys):
    train(tmp_path, 1)
    train(tmp_path, 2, "ppo.clip=0.3", resume=True, quiet=False)
    assert "resuming with ppo.clip = 0.3 instead of 0.2" in capsys.readouterr().out


def test_the_user_hears_of_every_stage(tmp_path, capsys):
    train(tmp_path, 2, quiet=False)
    lines = capsys.readouterr().out.splitlines()
    stages = ["building the task (cpu)", "toy task", "compiling", "compiled in", "8/16 steps"]
    assert [line[: len(stage)] for line, stage in zip(lines, stages, strict=False)] == stages
    assert lines[-1].strip() == f"getup-eval --ckpt {tmp_path}"


# --- divergence and full disks


def test_a_loss_that_is_not_finite_stops_the_run_and_keeps_the_last_good_checkpoint(tmp_path):
    with pytest.raises(TrainingError) as caught:
        train(tmp_path, 9, "train.save_every_s=0", learner=ToyLearner(bad_loss_at=4))
    text = str(caught.value)
    assert text.startswith("iteration 4: loss/value: not a finite number; the last good checkpoint")
    assert str(tmp_path / "checkpoints" / "00000003") in text
    assert saved(tmp_path) == [2, 3]
    assert np.isnan(read_metrics(tmp_path)[-1]["loss/value"])


def test_weights_that_are_not_finite_are_not_saved(tmp_path):
    with pytest.raises(TrainingError, match="iteration 3: a weight of the policy"):
        train(tmp_path, 9, "train.save_every_s=0", learner=ToyLearner(bad_weight_at=3))
    assert saved(tmp_path) == [1, 2]


def full_disk(*_: Any) -> None:
    raise CheckpointError("00000002: could not be saved: No space left on device")


def test_a_disk_that_is_full_for_a_while_does_not_end_the_run(tmp_path, monkeypatch, capsys):
    save = checkpoint.save_learner

    def sometimes(folder, iteration, *rest):
        return full_disk() if iteration == 2 else save(folder, iteration, *rest)

    monkeypatch.setattr(loop.checkpoint, "save_learner", sometimes)
    assert train(tmp_path, 4, "train.save_every_s=0", quiet=False) is None
    assert "warning: 00000002: could not be saved" in capsys.readouterr().out
    assert saved(tmp_path) == [3, 4]


def test_a_disk_that_is_full_at_the_end_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(loop.checkpoint, "save_learner", full_disk)
    with pytest.raises(CheckpointError, match="No space left"):
        train(tmp_path, 2)


# --- signals


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_saves_and_says_how_to_resume(tmp_path, unbroken, monkeypatch, capsys, number):
    update = Display.update

    def update_and_signal(self, steps, *rest):
        update(self, steps, *rest)
        if steps == 2 * PER_ITERATION:
            os.kill(os.getpid(), number)
            time.sleep(0.2)

    handlers = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with monkeypatch.context() as patch:
        patch.setattr(Display, "update", update_and_signal)
        assert train(tmp_path, 6, quiet=False) == number
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers
    assert_equals_unbroken(tmp_path, unbroken, 2)
    out = capsys.readouterr().out
    assert "stopping after this iteration" in out
    assert f"getup-train {tmp_path}/config.yaml --run {tmp_path} --resume" in out


STOPPED = """
import os, signal, sys, time
from getup_jax.runtime.signals import StopRequest
with StopRequest(print) as stop:
    if sys.argv[1] == "armed":
        with stop.armed():
            os.kill(os.getpid(), signal.SIGTERM)
            while stop.signal is None:
                time.sleep(0.01)
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.1)
            print("still here", flush=True)
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(30)
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(30)
"""


@pytest.mark.parametrize(("mode", "alive"), [("armed", True), ("not armed", False)])
def test_a_second_ctrl_c_and_one_before_the_loop_exit_at_once(mode, alive):
    command = [sys.executable, "-c", STOPPED, mode]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode == 128 + signal.SIGINT
    assert ("still here" in done.stdout) == alive
    assert done.stderr.strip() == "stopped at once; nothing was saved"
