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
    env, found = built.environment, set()
    state = jax.eval_shape(lambda key: env.init(built.world, key, 8), jax.random.PRNGKey(0))

    def note(frame, event, _):
        if event == "call":
            found.add(frame.f_code.co_filename)

    sys.setprofile(note)
    try:
        jax.eval_shape(env.step, built.world, state, state.action)
    finally:
        sys.setprofile(None)
    ours = [path for path in map(Path, found) if PACKAGE in path.parents]
    files = {str(path.relative_to(PACKAGE)) for path in ours}
    assert "envs/getup/task.py" in files
    assert len(files) <= MOST, sorted(files)
