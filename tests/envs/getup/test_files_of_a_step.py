"""How many files a reader opens to follow one step of the get-up task."""

from __future__ import annotations

import sys
from pathlib import Path

import jax
from tiny_task import changed, tiny_task

import getup_jax

PACKAGE = Path(getup_jax.__file__).parent
MOST = 20  # as docs/design.md says
EVERYTHING = changed(
    prioritisation=0.9, assistive_wrench=0.5, drawn_curves=0.5, short_share=0.3, track_weight=0.5
)


def test_a_step_runs_through_few_files(character):
    built = tiny_task(character, EVERYTHING)
    env, files = built.environment, set()
    state = jax.eval_shape(lambda key: env.init(built.world, key, 8), jax.random.PRNGKey(0))

    def note(frame, event, _):
        path = Path(frame.f_code.co_filename)
        if event == "call" and PACKAGE in path.parents:
            files.add(str(path.relative_to(PACKAGE)))

    sys.setprofile(note)
    try:
        jax.eval_shape(env.step, built.world, state, state.action)
    finally:
        sys.setprofile(None)
    assert "envs/getup/task.py" in files
    assert len(files) <= MOST, sorted(files)
