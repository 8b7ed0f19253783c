from __future__ import annotations

import dataclasses
import sys
import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import getups, neutral_prior

from eval_samples import SMALL, make_policy
from getup_jax.config import ConfigError
from getup_jax.envs.getup.action_decoder import ActionDecoder
from getup_jax.envs.getup.build import BuiltTask, assemble
from getup_jax.evaluation import outside
from getup_jax.evaluation.outside import (
    NAMES,
    OutsidePolicy,
    as_outside,
    is_outside,
    load_outside,
)
from getup_jax.evaluation.rollout import CHUNK, Trace, run_episodes
from getup_jax.evaluation.scenario import Scenario, make_plan
from getup_jax.physics.character import load_character
from getup_jax.release.onnx_graphs import Graph, PolicyParts, graphs

CONFIG = dataclasses.replace(SMALL, task=dataclasses.replace(SMALL.task, terminate_after_s=60.0))
EPISODES = 2


def built(config) -> BuiltTask:
    character = load_character(config.physics)
    prior = None if config.prior is None else neutral_prior(character)
    return assemble(config, character, getups(character), prior, lambda _: None)


def played(task: BuiltTask, learner, policy) -> Trace:
    _, _, styles, rows = task.world.pool.table.shape
    plan = make_plan(Scenario(start="standing", push_ns=20.0), EPISODES, styles, rows)
    return run_episodes(task, learner, policy, plan, lambda _: None).trace


class Session:
    """A graph of an exported policy, as onnxruntime would run it, one character a call."""

    def __init__(self, graph: Graph) -> None:
        self._graph, self._function = graph, jax.jit(graph.function)

    def get_inputs(self):
        shapes = self._graph.inputs.items()
        return [types.SimpleNamespace(name=name, shape=[1, *shape]) for name, shape in shapes]

    def run(self, _, values):
        found = self._function(*(values[name] for name in self._graph.inputs))
        return list(found) if isinstance(found, tuple) else [found]


@pytest.fixture(scope="module")
def outside_task() -> BuiltTask:
    return built(as_outside(CONFIG))


def test_an_exported_policy_does_outside_what_it_does_inside(outside_task):
    task = built(CONFIG)
    learner, policy = make_policy(task, CONFIG)
    rng = np.random.default_rng(0)
    weights = jax.tree.map(lambda x: x + rng.normal(0.0, 0.03, np.shape(x)), policy.actor)
    policy = policy.replace(actor=jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), weights))
    env, world = task.environment, task.world
    parts = PolicyParts(
        task=env,
        decoder=ActionDecoder(world.prior, env.config.offset_scale),
        act=lambda observation: learner.act(policy, observation),
        target_lower=np.asarray(world.target_lower),
        target_upper=np.asarray(world.target_upper),
    )
    made = {name: Session(graph) for name, graph in graphs(parts).items()}
    policy_outside = OutsidePolicy(
        "mine", lambda: outside._Exported(made["policy"], made["observation"], made["start"])
    )
    inside = played(task, learner, policy)
    found = played(outside_task, None, policy_outside)
    assert found.running.shape == inside.running.shape
    np.testing.assert_array_equal(found.running, inside.running)
    assert found.pushed.any()
    later = inside.pushed.argmax(axis=0).max() + 8  # what comes long after a push is chaotic
    np.testing.assert_allclose(found.qpos[:later], inside.qpos[:later], atol=2e-3)
    moved = np.abs(inside.qpos[:later] - inside.qpos[0])
    assert moved.max() > 0.05  # or the comparison says nothing


def test_each_batch_has_a_new_policy_that_is_told_by_name_and_obeyed(outside_task):
    task = outside_task
    neutral = task.environment.character.neutral_qpos[7:]
    made = []

    class Counts:
        def __init__(self) -> None:
            self.states = []
            made.append(self)

        def __call__(self, state):
            self.states.append({name: np.array(x) for name, x in state.items()})
            return np.tile(neutral + 0.001 * len(self.states), (EPISODES, 1))

    trace = played(task, None, OutsidePolicy("mine", Counts))
    (policy,) = made
    steps = len(trace.running)
    assert len(policy.states) == steps
    assert steps % CHUNK == 0
    first, second = policy.states[:2]
    assert set(first) == set(NAMES)
    assert first["ground"].shape == (EPISODES, 25)
    np.testing.assert_allclose(first["ground"], 0.0, atol=1e-6)
    np.testing.assert_allclose(first["time"], first["duration"])
    np.testing.assert_allclose(second["target"], neutral + 0.001 * np.ones((2, 1)), atol=1e-5)
    np.testing.assert_allclose(second["qpos"], trace.qpos[0], atol=1e-6)
    # of a push it knows a step later, as a policy of ours does
    push = int(trace.pushed.argmax(axis=0)[0])
    before, now, after = (policy.states[push + i]["qvel"] for i in (-1, 0, 1))
    changes = [np.linalg.norm(x, axis=-1) for x in (now - before, after - now)]
    assert (changes[1] > 3.0 * changes[0]).all(), changes


STATE = {"target": np.zeros((2, 3), np.float32)}


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (lambda _: np.zeros((3, 2)), r"expected servo targets of shape \(2, 3\), got \(3, 2\)"),
        (lambda _: np.full((2, 3), np.nan), "expected finite servo targets"),
        (lambda _: "no", "mine: failed: ValueError"),
        (
            lambda state: state["qpoz"],
            r"mine: failed: KeyError: 'qpoz' \(test_outside.py, line \d+\)",
        ),
        (lambda _: sys.exit(3), "mine: failed: SystemExit: 3"),
    ],
)
def test_what_a_policy_gets_wrong_is_one_line(act, message):
    with pytest.raises(ConfigError, match=message) as caught:
        OutsidePolicy("mine", lambda: act).begun().act(STATE)
    assert "\n" not in str(caught.value)


def test_a_function_and_a_class_are_found_by_their_names(tmp_path, monkeypatch):
    text = "def stay(state):\n    return state['target']\n\n\nclass Stay:\n"
    text += "    def __call__(self, state):\n        return state['target']\n"
    (tmp_path / "my_outside_policies.py").write_text(text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ("stay", "Stay"):
        policy = load_outside(f"my_outside_policies:{name}")
        np.testing.assert_array_equal(policy.begun().act(STATE), STATE["target"])
    with pytest.raises(ConfigError, match="expected a function or class 'Go' in my_outside"):
        load_outside("my_outside_policies:Go")
    with pytest.raises(ConfigError, match="no_such_thing:f: cannot be imported: ModuleNotFound"):
        load_outside("no_such_thing:f")
    with pytest.raises(ConfigError, match=r"is not a package; leave \.py off$"):
        load_outside("my_outside_policies.py:stay")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("flat", False), ("runs/flat", False), ("hf://me/flat", False), ("a:b", True),
        ("pack.mod:Cls", True), ("flat.onnx", True), ("C:\\runs\\flat", False),
    ],
)  # fmt: skip
def test_names_of_outside_policies(name, expected):
    assert is_outside(name) == expected


def test_files_that_are_no_graphs_are_said_in_one_line(tmp_path):
    pytest.importorskip("onnxruntime")
    with pytest.raises(ConfigError, match=r"nothing.onnx: no such file"):
        load_outside(str(tmp_path / "nothing.onnx"))
    (tmp_path / "bad.onnx").write_bytes(b"no graph")
    with pytest.raises(ConfigError, match=r"bad.onnx: not an ONNX file") as caught:
        load_outside(str(tmp_path / "bad.onnx"))
    assert "\n" not in str(caught.value)


def test_a_single_graph_may_take_any_of_the_names(tmp_path):
    """The last servo target again, of all characters in one call."""
    onnx = pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")

    def graph(name: str) -> str:
        kind = onnx.TensorProto.FLOAT
        ends = [onnx.helper.make_tensor_value_info(x, kind, ["B", 3]) for x in (name, "servo")]
        node = onnx.helper.make_node("Identity", [name], ["servo"])
        made = onnx.helper.make_graph([node], "again", ends[:1], ends[1:])
        model = onnx.helper.make_model(made, opset_imports=[onnx.helper.make_opsetid("", 21)])
        model.ir_version = 10
        onnx.save(model, str(tmp_path / f"{name}.onnx"))
        return str(tmp_path / f"{name}.onnx")

    state = {name: np.zeros((2, 1)) for name in NAMES} | {"target": np.arange(6.0).reshape(2, 3)}
    found = load_outside(graph("target")).begun().act(state)
    np.testing.assert_array_equal(found, state["target"])
    with pytest.raises(ConfigError, match="inputs speed: expected some of qpos, qvel, ground"):
        load_outside(graph("speed"))


def test_actions_are_targets_beside_the_neutral_pose(outside_task):
    env = outside_task.environment
    target = np.tile(env.character.neutral_qpos[7:] + 0.1, (2, 1))
    np.testing.assert_allclose(outside.to_action(env, target), 0.1, atol=1e-6)
    assert (env.action_size, env.config.filter, env.config.offset_scale) == (
        env.character.num_joints, 1.0, 1.0,
    )  # fmt: skip
    assert jnp.asarray(target).shape == (2, env.action_size)
