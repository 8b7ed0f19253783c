from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest

from eval_samples import SMALL, make_policy, make_task, run
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.evaluation import rollout
from getup_jax.evaluation.rollout import CHUNK, Episodes, episode_steps, run_episodes
from getup_jax.evaluation.scenario import PUSH_AFTER_S, Scenario, make_plan

PUSHED = Scenario(start="standing", push_ns=30.0, duration_scale=(0.8, 1.2))


@pytest.fixture(scope="module")
def task() -> BuiltTask:
    return make_task()


@pytest.fixture(scope="module")
def pushed(task) -> Episodes:
    return run(task, PUSHED, 4)


@pytest.fixture(scope="module")
def calm(task) -> Episodes:
    return run(task, dataclasses.replace(PUSHED, push_ns=None), 4)


def test_leaves_have_one_form_and_a_small_type(pushed):
    leaves = dataclasses.asdict(pushed.trace)
    assert {x.shape[:2] for x in leaves.values()} == {pushed.trace.running.shape}
    assert {x.dtype.name for x in leaves.values()} == {"float32", "bool"}


def test_durations_are_scaled(task, pushed):
    expected = np.asarray(task.world.duration)[pushed.getup] * pushed.plan.duration_scale
    np.testing.assert_allclose(pushed.trace.duration[0], expected, rtol=1e-6)
    assert len(set(pushed.plan.duration_scale)) == 4
    dt = task.environment.engine.control_dt
    np.testing.assert_allclose(pushed.trace.time[0], expected + dt, rtol=1e-6)  # standing starts


def test_an_episode_runs_until_it_ends_and_no_longer(task, pushed):
    running = pushed.trace.running
    assert running[0].all()
    assert not (running[1:] & ~running[:-1]).any()  # what has ended does not go on
    most = episode_steps(task, pushed.plan)
    assert running.sum(axis=0).max() <= most
    assert len(running) <= most + CHUNK


def test_every_running_episode_is_pushed_once_while_it_stands(pushed, calm):
    trace = pushed.trace
    assert (trace.pushed.sum(axis=0) == 1).all()
    step = trace.pushed.argmax(axis=0)
    since = (trace.time - trace.duration)[step, np.arange(4)]
    assert (since > PUSH_AFTER_S).all()
    assert (since < PUSH_AFTER_S + 0.5).all()
    assert not calm.trace.pushed.any()


def test_a_push_changes_nothing_before_it_and_moves_the_body_along_it(pushed, calm):
    step = int(pushed.trace.pushed.argmax(axis=0)[0])
    before, after = pushed.trace.qpos[:step], pushed.trace.qpos[step + 3]
    np.testing.assert_array_equal(before, calm.trace.qpos[:step])
    moved = (after - calm.trace.qpos[step + 3])[:, :2]
    along = (moved * pushed.plan.impulse[:, :2]).sum(axis=1) / 30.0
    assert (along > 0.005).all()


def test_jerk_needs_three_steps_and_is_that_of_the_joint_rates(task, calm):
    assert np.isnan(calm.trace.jerk[:2]).all()
    assert np.isfinite(calm.trace.jerk[2:][calm.trace.running[2:]]).all()


def test_overlaps_are_looked_at_once_a_chunk(calm):
    looked = np.isfinite(calm.trace.penetration)
    assert looked[CHUNK - 1 :: CHUNK].any()
    rest = np.ones(len(looked), bool)
    rest[CHUNK - 1 :: CHUNK] = False
    assert not looked[rest].any()
    assert not (looked & ~calm.trace.running).any()


def test_batches_change_nothing(task, calm, monkeypatch):
    monkeypatch.setattr(rollout, "BATCH", 3)  # four episodes are two batches of two
    parts = run(task, dataclasses.replace(PUSHED, push_ns=None), 4)
    running = calm.trace.running
    steps = len(parts.trace.running)
    np.testing.assert_array_equal(parts.trace.running, running[:steps])
    np.testing.assert_allclose(
        parts.trace.qpos[running[:steps]], calm.trace.qpos[:steps][running[:steps]], atol=1e-4
    )


def test_the_last_batch_is_filled_up_and_cut_again(task, monkeypatch):
    monkeypatch.setattr(rollout, "BATCH", 2)
    monkeypatch.setattr(rollout, "CHUNK", 30)
    assert run(task, Scenario(start="standing"), 3).trace.running.shape[1] == 3


def test_one_compile_serves_all_chunks_and_progress_ends_at_all(task, monkeypatch):
    made, jit, done = [], jax.jit, []
    monkeypatch.setattr(jax, "jit", lambda *a, **k: made.append(jit(*a, **k)) or made[-1])
    learner, policy = make_policy(task)
    plan = make_plan(PUSHED, 3, *task.world.pool.table.shape[2:])
    run_episodes(task, learner, policy, plan, done.append)
    monkeypatch.undo()
    assert [f._cache_size() for f in made if f.__name__ in ("start", "advance")] == [1, 1]
    assert done == sorted(done)
    assert done[-1] == 3.0


def test_the_longest_episode(task):
    lying = make_plan(Scenario(duration_scale=(1.2, 1.2)), 2, 2, 1)
    # the curves last 1 and 2 s
    assert episode_steps(task, lying) == pytest.approx((2.4 + SMALL.task.stand_time_s) * 30, abs=1)
    standing = make_plan(Scenario(start="standing"), 2, 2, 1)
    assert episode_steps(task, standing) == pytest.approx(SMALL.task.stand_time_s * 30, abs=1)
