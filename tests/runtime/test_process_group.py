from __future__ import annotations

import pytest

from getup_jax.runtime.process_group import Group, ProcessError, address_of

HERE = "127.0.0.1:4711"


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"coordinator": HERE}, "--processes, --process: missing"),
        ({"processes": 2, "process": 0}, "--coordinator: missing"),
        ({"coordinator": HERE, "processes": 0, "process": 0}, "--processes: expected at least 1"),
        ({"coordinator": HERE, "processes": 2, "process": 2}, "--process: expected 0 to 1, got 2"),
        ({"coordinator": HERE, "processes": 2, "process": -1}, "--process: expected 0 to 1"),
        ({"coordinator": "here", "processes": 2, "process": 0}, "expected HOST:PORT"),
        ({"coordinator": "a:0", "processes": 2, "process": 0}, "expected HOST:PORT"),
        ({"coordinator": "a:70000", "processes": 2, "process": 0}, "expected HOST:PORT"),
        ({"wait_s": 0.0}, "--wait: expected seconds above 0"),
        ({"wait_s": float("nan")}, "--wait: expected seconds above 0"),
    ],
)
def test_a_wrong_option_is_named(given, text):
    with pytest.raises(ProcessError) as raised:
        Group(**given)
    assert text in str(raised.value)
    assert "\n" not in str(raised.value)


def test_addresses():
    assert address_of("10.0.0.1:4711") == ("10.0.0.1", 4711)
    assert address_of("[fe80::1]:80") == ("fe80::1", 80)


def test_a_launcher_of_several_tasks_is_seen(monkeypatch):
    for name in ("SLURM_STEP_NUM_TASKS", "OMPI_COMM_WORLD_SIZE"):
        monkeypatch.delenv(name, raising=False)
    assert Group().alone
    assert Group(HERE, 1, 0).alone
    assert not Group(HERE, 2, 0).alone
    assert not Group(detect=True).alone
    monkeypatch.setenv("SLURM_STEP_NUM_TASKS", "1")
    assert Group().alone
    monkeypatch.setenv("SLURM_STEP_NUM_TASKS", "8")
    assert not Group().alone
