from __future__ import annotations

import numpy as np
import pytest
from test_metrics import DT, STAND_S, make_trace

from getup_jax.config import TaskConfig
from getup_jax.envs.getup.episode import STAND_LOWEST
from getup_jax.evaluation.verdicts import RULES, ended_early, host, verdicts

# curves of 1 s and 1 s of standing, in steps of half a second
RISEN = np.array([0.3, 0.8, 1.0, 1.0])


def judged(heights=RISEN, base=RISEN, success=True, **changes) -> dict[str, bool]:
    trace = make_trace(np.array(heights)[:, None], success=success, **changes)
    trace.head_gap = changes.get("head_gap", np.ones((len(heights), 1)))
    found = verdicts(trace, np.array(base)[:, None], STAND_S, DT)
    assert set(found) == set(RULES)
    return {rule: bool(value[0]) for rule, value in found.items()}


def test_who_stands_up_and_remains_standing_has_succeeded_by_every_rule():
    assert set(judged().values()) == {True}


def test_a_dip_while_standing_counts_for_the_thesis_alone():
    assert judged([0.3, 0.8, STAND_LOWEST - 0.01, 1.0]) == {
        "ours": True, "sca2022": True, "thesis": False, "host": True
    }  # fmt: skip


def test_who_is_down_at_the_end_has_not_remained_standing():
    down = [0.3, 0.8, 1.0, 0.5]
    assert set(judged(down, down, success=False).values()) == {False}


def test_who_never_rises_has_failed_by_every_rule():
    flat = [0.3] * 4
    assert set(judged(flat, flat, success=False).values()) == {False}


@pytest.mark.parametrize("name", ["task_reward", "head_gap"])
def test_an_early_end_fails_but_not_by_the_rule_of_host(name):
    """Half a second is longer than what the rule allows."""
    value = {"task_reward": [1.0, 0.05, 1.0, 1.0], "head_gap": [0.01, 1.0, 1.0, 1.0]}[name]
    found = judged(**{name: np.array(value)[:, None]})
    assert found == {"ours": False, "sca2022": False, "thesis": False, "host": True}


def test_a_simulation_that_fails_before_the_end_has_failed():
    running = np.array([[True], [True], [True], [False]])
    assert set(judged(running=running, success=False).values()) == {False}


@pytest.mark.parametrize(
    ("heights_m", "expected"),
    [
        ([0.2, 0.65, 0.71], True),
        ([0.2, 0.65, 0.69], False),
        ([0.2, 0.71, 0.51], True),
        ([0.2, 0.71, 0.49, 0.8], False),  # whatever comes later
        ([0.49, 0.2, 0.71], True),  # low before it stood
    ],
)
def test_the_rule_of_host_on_its_own_robot(heights_m, expected):
    base = np.array(heights_m)[:, None] / 0.75
    assert host(base, np.ones_like(base, bool)).tolist() == [expected]


def test_steps_after_the_end_mean_nothing_to_the_rule_of_host():
    base, running = np.array([[0.2], [1.0], [0.1]]), np.array([[True], [True], [False]])
    assert host(base, running).all()
    assert not host(base[[0, 0, 1]], running).any()


def test_early_termination_are_counted_as_the_task_counts_them():
    """Nine bad steps in a row at 30 Hz are 0.3 s and no more; the tenth ends an episode."""
    dt = 1 / 30
    most = round(TaskConfig.terminate_after_s / dt)
    low = np.ones((4 * most, 3))
    low[3 : 3 + most, 0] = 0.0
    low[3 : 4 + most, 1] = 0.0
    low[3 : 4 + most, 2] = 0.0
    low[5, 2] = 1.0
    trace = make_trace(np.ones_like(low), task_reward=low)
    trace.head_gap = np.ones_like(low)
    assert ended_early(trace, dt).tolist() == [False, True, False]
