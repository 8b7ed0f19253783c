"""An exported policy computes what JAX does, through the real runtime."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import CONFIG, getups, untrained_prior

from getup_jax.config import ConfigError, NetworkConfig
from getup_jax.envs.getup.action_decoder import ActionDecoder
from getup_jax.envs.getup.build import assemble
from getup_jax.physics.character import load_character
from getup_jax.release import onnx_export
from getup_jax.release.onnx_graphs import PolicyParts, graphs
from getup_jax.rl.learner import make_learner

pytest.importorskip("jax2onnx")
runtime = pytest.importorskip("onnxruntime")
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def built():
    """A tiny task in whole episodes, with a mirrored prior of random weights."""
    # a random policy falls, which must not end the episode
    task = dataclasses.replace(CONFIG.task, terminate_after_s=60.0)
    config = dataclasses.replace(CONFIG, task=task)
    character = load_character(config.physics)
    prior = untrained_prior(character, mirrored=True)
    return assemble(config, character, getups(character), prior, lambda _: None)


@pytest.fixture(scope="module")
def parts(built):
    """A policy of random weights, whose observations are normalised."""
    env, world = built.environment, built.world
    learner = make_learner(env, NetworkConfig(hidden_sizes=(16, 16)), CONFIG.ppo, total_steps=1)
    policy = learner.init_learner(jax.random.PRNGKey(0)).policy
    policy = jax.tree.map(lambda x: x + 0.1 * np.random.default_rng(1).normal(size=x.shape), policy)
    policy = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), policy)
    statistics = policy.statistics.replace(variance=jnp.abs(policy.statistics.variance))
    policy = policy.replace(statistics=statistics)
    return PolicyParts(
        task=env,
        decoder=ActionDecoder(world.prior, env.config.offset_scale),
        act=lambda observation: learner.act(policy, observation),
        target_lower=np.asarray(world.target_lower),
        target_upper=np.asarray(world.target_upper),
    )


@pytest.fixture(scope="module")
def sessions(parts):
    return {
        name: runtime.InferenceSession(onnx_export.to_onnx(name, graph).SerializeToString())
        for name, graph in graphs(parts).items()
    }


def run(session, **values):
    return session.run(None, {k: np.asarray(v, np.float32) for k, v in values.items()})


def test_all_graphs_agree_with_jax_over_a_whole_episode(built, parts, sessions):
    env, world = built.environment, built.world
    zero = jnp.zeros(1, jnp.int32)
    state = jax.jit(env.start)(world, zero, zero, zero)
    advance, act = jax.jit(env.advance), jax.jit(parts.act)
    target_of = jax.jit(lambda action, state: env.servo_target(world, state, action))
    curve = {"points": state.points, "duration": state.duration}
    (action,) = run(sessions["start"], qpos=state.physics.kinematics.qpos, time=state.time, **curve)
    np.testing.assert_allclose(action, state.action, atol=1e-4)
    steps, ended = 0, False
    while not ended:
        seen = state.physics.kinematics
        (observation,) = run(
            sessions["observation"],
            qpos=seen.qpos,
            qvel=seen.qvel,
            ground=np.zeros((1, 25)),
            time=state.time,
            action=action,
            **curve,
        )
        np.testing.assert_allclose(observation, state.observation, atol=1e-4)
        target, action = run(sessions["policy"], observation=observation)
        before = state
        state, output = advance(world, state, act(state.observation))
        np.testing.assert_allclose(action, state.action, atol=1e-4)
        np.testing.assert_allclose(target, target_of(state.action, before), atol=1e-4)
        assert np.ptp(target - np.asarray(before.physics.kinematics.qpos[:, 7:])) > 0.05
        steps, ended = steps + 1, bool(output.done[0])
    assert bool(output.truncated[0])
    assert steps == round((float(state.duration[0]) + env.config.stand_time_s) * 30)


def test_what_cannot_be_exported_is_one_line(tmp_path, monkeypatch):
    with pytest.raises(ConfigError, match="is of composite motion"):
        onnx_export.export_onnx("walk", tmp_path / "walk.onnx")
    monkeypatch.setitem(sys.modules, "jax2onnx", None)
    with pytest.raises(ConfigError, match=r"pip install 'getup-jax\[onnx\]'"):
        onnx_export.export_onnx("flat", tmp_path / "flat.onnx")


@pytest.mark.slow
def test_the_shipped_policy_gets_up_without_jax(tmp_path):
    file = tmp_path / "flat.onnx"
    files = onnx_export.export_onnx("flat", file)
    assert [f.name for f in files] == [
        *("flat.onnx", "flat_observation.onnx", "flat_start.onnx", "flat.xml")
    ]
    import onnx

    (entry,) = (e for e in onnx.load(str(file)).metadata_props if e.key == onnx_export.METADATA)
    facts = json.loads(entry.value)
    assert len(facts["styles"]) == 28
    assert sum(facts["observation"].values()) == 352
    code = "import sys; sys.modules['jax'] = None; import runpy; runpy.run_path(sys.argv.pop(1))"
    script = str(ROOT / "examples/onnx_numpy.py")
    done = subprocess.run(
        [sys.executable, "-c", code, script, str(file)], capture_output=True, text=True, check=True
    )
    height = float(done.stdout.split("pelvis is ")[1].split(" m")[0])
    assert height > 0.75
