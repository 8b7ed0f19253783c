"""The newest learner of a run folder, for benchmarks that look at it while it does not learn."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import jax

from getup_jax.config import Config
from getup_jax.config.load import load_saved_config
from getup_jax.rl.learner import Learner
from getup_jax.runtime import checkpoint
from getup_jax.runtime.checkpoint import LoadedLearner
from getup_jax.runtime.pytree_store import from_nested


def parser_of_run(doc: str | None, quick: str) -> argparse.ArgumentParser:
    """The arguments that they share: RUN, --seed and --quick, which is `quick` for `make bench`."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("run", type=Path, nargs="?", help="a run folder of the get-up task")
    add("--seed", type=int, default=0)
    add("--quick", action="store_true", help=f"for `make bench`: {quick}")
    return parser


def load_run(run: Path | None) -> tuple[Config, LoadedLearner] | None:
    """The run's config and newest learner; None, and a line that says so, where none is given."""
    if run is None:
        print("skipped: needs a run folder")
        return None
    loaded = checkpoint.load_learner(run)
    return load_saved_config(loaded.path.parent / "config.yaml"), loaded


def learner_state(learner: Learner, loaded: LoadedLearner) -> Any:
    """The loaded arrays as the learner's state."""
    template = jax.eval_shape(learner.init_learner, jax.random.PRNGKey(0))
    return from_nested(template, loaded.learner, str(loaded.path))
