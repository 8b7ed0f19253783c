from __future__ import annotations

from getup_jax.release.engine_line import engine_table


def evaluation(engine: str, success: float, seed: int = 0) -> dict:
    conditions = {"engine": engine, "start": "lying", "seed": seed, "start_noise_rad": 0.05}
    return {
        "conditions": conditions,
        "success": success,
        "success_low": success - 0.01,
        "success_high": success + 0.01,
        "episodes": 1000,
    }


def test_engines_stand_side_by_side():
    found = [evaluation("mjx-warp", 0.9), evaluation("native", 0.95), evaluation("native", 0.8, 1)]
    assert engine_table(found).splitlines()[2:] == [
        "| | native | mjx-warp |",
        "|---|---|---|",
        "| lying starts, seed 0, joint noise 0.05 rad | 95.0% (94.0% - 96.0%, 1000) "
        "| 90.0% (89.0% - 91.0%, 1000) |",
    ]


def test_an_engine_that_was_not_asked_has_no_number():
    found = [evaluation(e, 0.5, s) for e, s in (("native", 0), ("mjx", 0), ("native", 1))]
    found.append(evaluation("mjx-warp", 0.25, 1))
    rows = engine_table(found).splitlines()
    assert rows[2] == "| | native | mjx | mjx-warp |"
    assert rows[4].endswith("| - |")
    assert "| - | 25.0%" in rows[5]


def test_one_engine_alone_needs_no_table():
    assert engine_table([evaluation("native", 0.9), evaluation("native", 0.8, 1)]) == ""
    assert engine_table([]) == ""
