from __future__ import annotations

import pytest

import other_bodies
from other_bodies import Simulator


def test_a_rate_counts_every_simulation_for_as_long_as_it_is_asked(monkeypatch):
    clock, steps = iter(range(100)), []
    monkeypatch.setattr(other_bodies.time, "perf_counter", lambda: float(next(clock)))
    simulator = Simulator(23, 5, lambda: steps.append(1), 8)
    # from 0 on: looked at after 1, 2 and 3 s, the last time at 4 s
    assert other_bodies.rate(simulator, 3.0) == pytest.approx(8 * len(steps) / 4.0)
    assert len(steps) == 3


def test_the_table_has_physics_steps_and_says_what_is_not_there(capsys):
    known = {"degrees": 23, "simulations": 8, "substeps": 5, "control_steps_per_s": 200.0}
    other_bodies.show({"envpool": known, "playground": {"missing": "No module"}})
    text = capsys.readouterr().out
    assert "1,000" in text
    assert "not installed: No module" in text
    assert "another body" in text
