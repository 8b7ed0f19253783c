"""The benchmark for anybody's policy: fixed starts, styles, grounds and pushes, several rules.

One rollout of the evaluator a suite, without early ends; see `verdicts.py` for the rules. A number
of a suite that changes makes another `VERSION`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from getup_jax.config import Config, ConfigError, PhysicsConfig, TaskConfig
from getup_jax.config.load import load_config
from getup_jax.evaluation.getup import Entry, Rate, evaluation_config, run
from getup_jax.evaluation.metrics import episode_values, wilson
from getup_jax.evaluation.outside import as_outside, is_outside, load_outside
from getup_jax.evaluation.rollout import Episodes
from getup_jax.evaluation.scenario import Scenario
from getup_jax.evaluation.verdicts import RULES, verdicts_of
from getup_jax.physics.terrain_map import REGIONS
from getup_jax.runtime import checkpoint
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.console import Display

VERSION = 1
SEED = 1000  # of starts, pushes and ground; no training of ours has it
PLANE = "plane"
PUSHES_NS = (0.0, 20.0, 40.0)
STYLES = 28  # of configs/flat.yaml
ROUNDS = 4  # of all styles, for each push; on irregular ground one in each of its four regions
# what a policy may have of its own; the rest of the task is the benchmark's
_OWN = ("lookahead_s", "filter", "offset_scale", "offset_limit_rad", "target_margin_rad")


@dataclasses.dataclass(frozen=True)
class Suite:
    """Episodes on one ground from one kind of start."""

    irregular: bool
    starts: str  # in words
    scenario: Scenario

    @property
    def episodes(self) -> int:
        """How many."""
        assert self.scenario.episodes is not None
        return self.scenario.episodes


def suites(quick: bool = False) -> dict[str, Suite]:
    """The suites by name; quick: a round of one, to see that a policy runs."""
    pushes = PUSHES_NS[:2] if quick else PUSHES_NS
    number = STYLES * len(pushes) * (1 if quick else ROUNDS)

    def suite(starts: str, irregular: bool = False, **given: Any) -> Suite:
        common = {"episodes": number, "pushes_ns": pushes, "seed": SEED, "early_termination": False}
        if irregular:
            common["terrain_seed"] = SEED
        return Suite(irregular, starts, Scenario(**common, **given))

    own = suite("first poses of the motions, .1 rad of noise on every hinge", start_noise_rad=0.1)
    if quick:
        return {"own": own}
    return {
        "own": own,
        "mixed": suite("the same, curves mixed of two", start_noise_rad=0.1, blend="random"),
        "limp": suite("dropped limp", drops="limp"),
        "fallen": suite("pushed over while standing", drops="fallen"),
        "slopes": suite("dropped limp", irregular=True),
        "slopes fallen": suite("pushed over while standing", irregular=True, drops="fallen"),
    }


@dataclasses.dataclass(frozen=True)
class Cell:
    """Episodes that have ground and push in common."""

    suite: str
    ground: str  # PLANE, or a region
    push_ns: float
    episodes: int
    successes: dict[str, int]  # by rule

    def share(self, rule: str) -> tuple[float, float, float]:
        """Success, and its 95 % Wilson interval."""
        count = self.successes[rule]
        return (count / self.episodes, *wilson(count, self.episodes))


@dataclasses.dataclass(frozen=True, eq=False)
class Result:
    """What a policy came to."""

    name: str
    facts: dict[str, Any]  # of the policy
    quick: bool
    cells: list[Cell]
    motion: dict[str, dict[str, float]]  # suite -> how it moves

    @property
    def missing(self) -> list[str]:
        """The suites that have not been run."""
        return [name for name in suites(self.quick) if name not in self.motion]

    def total(self, **same: Any) -> Cell:
        """All cells in which these fields (suite, ground, push_ns) are so, as one."""
        found = [x for x in self.cells if all(getattr(x, k) == v for k, v in same.items())]
        sums = {rule: sum(x.successes[rule] for x in found) for rule in RULES}
        return Cell("all", "all", 0.0, sum(x.episodes for x in found), sums)


def find_entry(name: str) -> Entry:
    """Who that is: a checkpoint, shipped or not, an ONNX file, or `module:function`.

    Raises ConfigError or CheckpointError, in one line.
    """
    if is_outside(name):
        return Entry(load_outside(name), as_outside(load_config("flat")), name)
    loaded = checkpoint.load_policy(name)
    if loaded.config.composite_motion:
        raise ConfigError(f"{name}: is of composite motion; expected a policy that gets up")
    _check_physics(name, loaded.config.physics)
    return Entry(loaded, loaded.config, name)


def _check_physics(name: str, physics: PhysicsConfig) -> None:
    """Raise ConfigError for a policy of another body or simulation."""
    ours, free = PhysicsConfig(), ("engine", "threads")
    for field in dataclasses.fields(PhysicsConfig):
        got, expected = getattr(physics, field.name), getattr(ours, field.name)
        if field.name not in free and got != expected:
            raise ConfigError(
                f"{name}: was trained with physics.{field.name}={got}, the benchmark has "
                f"{expected}; enter a policy of configs/flat.yaml's body"
            )


def config_of(config: Config, irregular: bool) -> Config:
    """The benchmark's task, with what is a policy's own: its networks, and how it acts and looks.

    A policy sees heights as it is used to: `terrain.relief_gain` is that of its training.
    """
    base = load_config("terrain" if irregular else "flat")
    own = {name: getattr(config.task, name) for name in _OWN}
    terrain = base.terrain
    if terrain is not None:
        gain = 1.0 if config.terrain is None else config.terrain.relief_gain
        terrain = dataclasses.replace(terrain, relief_gain=gain)
    return dataclasses.replace(
        config,
        physics=PhysicsConfig(engine=config.physics.engine),
        task=dataclasses.replace(TaskConfig(), **own),
        terrain=terrain,
        motion=base.motion,
    )


def run_bench(entry: Entry, quick: bool, engine: str | None, display: Display) -> Iterator[Result]:
    """All suites, one after the other: what it has come to after each of them.

    `display` counts their episodes.
    """
    wanted, cells, motion = suites(quick), [], {}
    rate, before = Rate(display, sum(x.episodes for x in wanted.values())), 0
    for name, suite in wanted.items():
        display.log(f"{name}: {suite.starts}")
        scenario = dataclasses.replace(suite.scenario, engine=engine)
        config = config_of(entry.config, suite.irregular)
        own = dataclasses.replace(entry, config=config)

        def progress(done: float, before: int = before) -> None:
            rate(before + done)

        episodes = run(own, scenario, display.log, progress)
        cells += list(cells_of(name, episodes, scenario))
        motion[name] = _motion(episodes)
        before += suite.episodes
        yield Result(entry.name, _facts(entry), quick, list(cells), dict(motion))


def cells_of(suite: str, episodes: Episodes, scenario: Scenario) -> Iterator[Cell]:
    """The episodes of a suite by ground and push."""
    verdicts, plan = verdicts_of(episodes), episodes.plan
    region = np.zeros(len(plan.getup), int) if plan.region is None else plan.region
    names = (PLANE,) if plan.region is None else REGIONS
    push = np.linalg.norm(plan.impulse, axis=-1)
    for index, ground in enumerate(names):
        for push_ns in scenario.pushes_ns:
            own = (region == index) & np.isclose(push, push_ns)
            if own.any():
                counts = {rule: int(verdicts[rule][own].sum()) for rule in RULES}
                yield Cell(suite, ground, push_ns, int(own.sum()), counts)


def _motion(episodes: Episodes) -> dict[str, float]:
    """How it moves: means over the episodes of what `getup-eval` says."""
    env = episodes.task.environment
    values = episode_values(episodes.trace, env.engine.control_dt, env.config.stand_time_s)
    kept = ("return_rate", "height_error_m", "angle_error_rad", "jitter", "energy_j", "torque_nm")
    known = {name: values[name][np.isfinite(values[name])] for name in kept}
    return {name: float(x.mean()) if x.size else math.nan for name, x in known.items()}


def _facts(entry: Entry) -> dict[str, Any]:
    if not isinstance(entry.policy, LoadedPolicy):
        return {"outside": True}
    return {"outside": False, "seed": entry.policy.config.seed, **entry.policy.metadata}


def check(entry: Entry, quick: bool, engine: str | None) -> int:
    """How many episodes there will be; ConfigError for what no suite can do, before the first."""
    for suite in suites(quick).values():
        scenario = dataclasses.replace(suite.scenario, engine=engine)
        evaluation_config(config_of(entry.config, suite.irregular), scenario)
    return sum(suite.episodes for suite in suites(quick).values())
