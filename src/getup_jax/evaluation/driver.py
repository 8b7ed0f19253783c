"""One evaluation of any policy: what it is asked, its scores, and what can be written of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

from getup_jax.evaluation import composite, composite_film, getup, meta_weights_plot, plot
from getup_jax.evaluation import control_gain as gain
from getup_jax.evaluation import film as films
from getup_jax.evaluation import table as tables
from getup_jax.evaluation.composite import CompositeScores
from getup_jax.evaluation.metrics import Scores, to_json
from getup_jax.evaluation.scenario import Scenario
from getup_jax.evaluation.turntable import write_turntable
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.console import Display


@dataclasses.dataclass(frozen=True, eq=False)
class Evaluation:
    """What came of the episodes of one scenario."""

    scores: Scores | CompositeScores
    table: str  # for people
    facts: dict[str, Any]  # for JSON: scores, policy, conditions
    film: Callable[[Path, tuple[int, int]], None]  # writes an .mp4 of that size (rows, columns)
    turntable: Callable[[Path], None]  # writes stills from all around
    plot: Callable[[Path], None]  # writes a picture
    takes: Callable[[Path], None]  # writes animations, a .glb or USD file


def episode_count(loaded: LoadedPolicy, scenario: Scenario, plotted: bool = False) -> int:
    """How many episodes there will be; raises ConfigError for what cannot be asked of the policy.

    plotted: `Evaluation.plot` will be asked for, which not every policy has.
    """
    if not loaded.config.composite_motion:
        return getup.evaluation_config(loaded.config, scenario).task.pool_size
    scenario.check_composite()
    if plotted:
        assert loaded.config.composite is not None
        meta_weights_plot.check(loaded.config.composite)
    return composite.episode_count(scenario)


def evaluate(loaded: LoadedPolicy, scenario: Scenario, display: Display) -> Evaluation:
    """Run and score the episodes; raises ConfigError where the policy cannot be asked that."""
    display.log(f"{loaded.path}: {loaded.metadata.get('steps', 0):,} steps of training")
    if loaded.config.composite_motion:
        return _of_composite(loaded, scenario, display)
    episodes, scores = getup.evaluate(loaded, scenario, display)
    table, facts = tables.table(scores), getup.description(loaded, scenario, episodes)
    if scenario.edits:
        control = getup.evaluate_edits(loaded, episodes.task, scenario, display.log)
        table = f"{table}\n{gain.table({str(loaded.path): control})}"
        facts["control_gain"] = gain.to_json(control)
        facts["success_edits"] = control.success
    return Evaluation(
        scores=scores,
        table=table,
        facts={**to_json(scores), **facts},
        film=lambda path, size: films.film(path, episodes, size),
        turntable=lambda path: write_turntable(
            path, episodes.task.environment.character.model, films.most_typical(episodes)
        ),
        plot=lambda path: plot.plot(path, episodes),
        takes=lambda path: films.write_takes(path, episodes),
    )


def _of_composite(loaded: LoadedPolicy, scenario: Scenario, display: Display) -> Evaluation:
    built, episodes, scores = composite.evaluate(loaded, scenario, display)
    character = built.environment.character
    return Evaluation(
        scores=scores,
        table=composite.table(scores),
        facts={**composite.to_json(scores), **composite.description(loaded, scenario, built)},
        film=lambda path, size: composite_film.film(path, built, episodes, size),
        turntable=lambda path: write_turntable(path, character.model, episodes.qpos[0]),
        plot=lambda path: meta_weights_plot.plot_weights(path, character, episodes),
        takes=lambda path: composite_film.write_takes(path, built.environment, episodes),
    )
