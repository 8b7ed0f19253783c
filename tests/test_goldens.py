"""Two tiny iterations of every kind of training, beside what they gave when this was last recorded.

    python tests/test_goldens.py        # record goldens.json anew, after a change that was meant

Other machines round otherwise, so the test leaves them a little room; a change of the code that
should change nothing is checked on one machine with `python tests/test_goldens.py --exact`.
"""

from __future__ import annotations

import json
import math
import sys
import time
from pathlib import Path

import jax
import numpy as np
import pytest

from getup_jax.config.load import load_config
from getup_jax.training.run import build_job

FILE = Path(__file__).with_name("goldens.json")
PPO = ["ppo.num_envs=8", "ppo.num_steps=4", "ppo.minibatch_size=16", "ppo.epochs=1"]
GETUP = [*PPO, "network.hidden_sizes=[8]", "task.pool_size=672"]
COMPOSITE = [
    *PPO,
    "network.hidden_sizes=[8]",
    "network.gru_size=8",
    "composite.discriminator.gru_size=8",
    "composite.discriminator.hidden_sizes=[8]",
    "composite.discriminator.minibatch_size=16",
]
RUNS = {
    "flat": ["configs/flat.yaml", *GETUP],
    "getup": ["configs/getup.yaml", *GETUP],
    "terrain": ["configs/terrain.yaml", *GETUP],
    "composite": ["configs/composite_wave_squat.yaml", *COMPOSITE],
    "meta": ["configs/composite_walk_aim.yaml", *COMPOSITE],
}
ITERATIONS = 2
QUICK = ("getup",)  # the others are slow: they compile discriminators, or make start states


def measure(name: str) -> list[dict[str, float | None]]:
    """The metrics of every iteration; None where there is no number."""
    path, *overrides = RUNS[name]
    config = load_config(path, overrides)

    def log(text: str) -> None:
        pass

    job = build_job(config, log)
    state = jax.jit(job.learner.init)(job.world, jax.random.PRNGKey(config.seed))
    iterate, found = jax.jit(job.learner.iteration), []
    for _ in range(ITERATIONS):
        state, metrics = iterate(job.world, state)
        values = {key: float(value) for key, value in jax.device_get(metrics).items()}
        found.append({k: v if math.isfinite(v) else None for k, v in sorted(values.items())})
    return found


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in RUNS]
)
def test_training_is_what_it_was(name):
    expected = json.loads(FILE.read_text(encoding="utf-8"))[name]
    for was, now in zip(expected, measure(name), strict=True):
        assert list(was) == list(now)
        for key, value in was.items():
            if value is None:
                assert now[key] is None, key
            else:
                np.testing.assert_allclose(now[key], value, rtol=2e-3, atol=1e-4, err_msg=key)


def main() -> None:
    names = [name for name in sys.argv[1:] if name in RUNS] or list(RUNS)
    known = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    for name in names:
        begin = time.monotonic()
        found = measure(name)
        seconds = time.monotonic() - begin
        if "--exact" in sys.argv:
            print(name, "same" if found == known.get(name) else "OTHER", f"{seconds:.0f} s")
        else:
            known[name] = found
            print(name, f"{seconds:.0f} s")
    if "--exact" not in sys.argv:
        FILE.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
