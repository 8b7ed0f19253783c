"""Runs a trained policy without noise, once an episode, and scores it."""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np

from getup_jax.config import Config, ConfigError, TaskConfig, TerrainConfig
from getup_jax.config.task import OWN_POSES
from getup_jax.envs.getup.build import BuiltTask, build_task
from getup_jax.envs.getup.episode import LAST_S, STAND_LOWEST, STAND_MEAN
from getup_jax.envs.getup.resets.rag_doll import DROPS
from getup_jax.envs.getup.task import GetUpTask
from getup_jax.evaluation import control_gain
from getup_jax.evaluation.control_gain import ControlGain
from getup_jax.evaluation.ground_kinds import Places
from getup_jax.evaluation.metrics import Scores, episode_values, score
from getup_jax.evaluation.outside import OutsidePolicy
from getup_jax.evaluation.reference_error import reference_errors
from getup_jax.evaluation.rollout import Episodes, Progress, run_episodes
from getup_jax.evaluation.scenario import (
    DROPPED,
    Plan,
    Scenario,
    blended,
    drawn,
    make_plan,
    of_config,
)
from getup_jax.motion.clips import GetUp
from getup_jax.motion.io.curve_file import read_curve_file
from getup_jax.physics.body_digest import body_digest, warn_if_other
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.terrain_map import REGIONS
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.pose_prior.prior import PosePrior
from getup_jax.rl.learner import Learner, make_learner
from getup_jax.rl.state import PolicyState
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.console import Display
from getup_jax.runtime.pytree_store import from_nested

_EPISODES = 100  # by default; on irregular ground in each region
_NEVER_S = 3600.0  # longer than any episode
_DROPS, _FLAT_DROPS = 1500, 500  # bodies that fall on irregular ground, and on flat ground

Choice = Callable[[tuple[GetUp, ...], CharacterSpec], tuple[GetUp, ...]]


def evaluate(loaded: LoadedPolicy, scenario: Scenario, display: Display) -> tuple[Episodes, Scores]:
    """Run and score the episodes; raises ConfigError where the policy cannot be asked that."""
    number = evaluation_config(loaded.config, scenario).task.pool_size
    episodes = run(Entry.of(loaded), scenario, display.log, Rate(display, number))
    return episodes, scores_of(episodes)


@dataclasses.dataclass(frozen=True, eq=False)
class Entry:
    """Who is evaluated, under which config: a policy of this package, or one from outside."""

    policy: LoadedPolicy | OutsidePolicy
    config: Config
    name: str  # for people

    @classmethod
    def of(cls, loaded: LoadedPolicy) -> Entry:
        """A policy as it was trained."""
        return cls(loaded, loaded.config, str(loaded.path))

    @property
    def prior(self) -> PosePrior | None:
        """What its latent actions mean; None: there are none."""
        outside = isinstance(self.policy, OutsidePolicy)
        return None if outside else pose_prior.from_checkpoint(self.policy.prior)


def run(
    entry: Entry, scenario: Scenario, log: Callable[[str], None], progress: Progress
) -> Episodes:
    """The episodes of a scenario; raises ConfigError where the policy cannot be asked that."""
    config, policy = evaluation_config(entry.config, scenario), entry.policy
    task = build_task(config, log, entry.prior, chosen_styles(config, scenario))
    learner: Learner | None = None
    state: Any = policy
    if not isinstance(policy, OutsidePolicy):
        body = body_digest(task.environment.character.model)
        warn_if_other(policy.path, policy.metadata, body, log)
        learner, state = restore_policy(policy, task)
    plan = planned(task, scenario, config.task.pool_size)
    log("compiling the episode ...")
    return run_episodes(task, learner, state, plan, progress)


def planned(task: BuiltTask, scenario: Scenario, number: int) -> Plan:
    """The episodes of a scenario in a task that was built for it."""
    pool = task.world.pool
    _, regions, num_styles, rows = pool.table.shape
    if pool.startable is None:
        return make_plan(scenario, number, num_styles, rows)
    return make_plan(scenario, number, num_styles, rows, regions).on_regions(pool)


def scores_of(episodes: Episodes) -> Scores:
    """What the episodes come to."""
    plan, getups = episodes.plan, episodes.task.getups
    return score(_values(episodes), plan.getup, getups, plan.kind, places_of(episodes))


def _values(episodes: Episodes) -> dict[str, np.ndarray]:
    """What there is to say of every episode [N]."""
    env, trace, plan = episodes.task.environment, episodes.trace, episodes.plan
    values = episode_values(trace, env.engine.control_dt, env.config.stand_time_s)
    if plan.points is not None:  # other curves than those of the motions
        return values
    errors = reference_errors(trace, plan.getup, episodes.task.getups, env.character)
    return values | {"reference_error_m": errors}


def places_of(episodes: Episodes) -> Places | None:
    """Where the episodes start on irregular ground; None on a flat plane."""
    task, plan = episodes.task, episodes.plan
    terrain = task.environment.terrain
    if terrain is None or plan.region is None:
        return None
    pool = task.world.pool
    index = np.asarray(pool.table)[plan.kind, plan.region, plan.getup, plan.row]
    xy = np.asarray(pool.physics.kinematics.qpos)[index, :2]
    return Places.of(plan.region, xy, terrain)


def evaluate_edits(
    loaded: LoadedPolicy, task: BuiltTask, scenario: Scenario, log: Callable[[str], None]
) -> ControlGain:
    """How well the policy obeys edits of the task's curves; see `evaluation/control_gain.py`."""
    learner, policy = restore_policy(loaded, task)
    plan = control_gain.edit_plan(task, scenario.edits, scenario.seed)
    number = len(plan.getup)
    log(f"{scenario.edits} edits of each curve ...")
    with Display(number, unit="episodes") as display:
        return control_gain.measure(task, learner, policy, plan, Rate(display, number))


def evaluation_config(config: Config, scenario: Scenario) -> Config:
    """The training config with the starts that are asked for, as many as there are episodes.

    Start noise is that of the scenario and the early-end rule is the default one, that of the
    paper, not those of the training, so that two policies meet the same starts and the same rule.
    """
    physics, task = config.physics, config.task
    if scenario.engine is not None:
        solver = "auto" if physics.solver == "pgs" else physics.solver  # MJX has no PGS
        physics = dataclasses.replace(physics, engine=scenario.engine, solver=solver)
    stand_time_s = task.stand_time_s if scenario.stand_time_s is None else scenario.stand_time_s
    task = dataclasses.replace(
        task,
        stand_start=float(scenario.start == "standing"),
        start_noise_rad=scenario.start_noise_rad,
        terminate_reward=TaskConfig.terminate_reward,
        pool_size=_episode_count(config, scenario),
        stand_time_s=stand_time_s,
        terminate_after_s=task.terminate_after_s if scenario.early_termination else _NEVER_S,
        **_dropped(task, scenario.drops),
    )
    terrain = _evaluation_terrain(config.terrain, scenario)
    config = dataclasses.replace(
        config, physics=physics, task=task, curriculum=None, terrain=terrain, seed=scenario.seed
    )
    scenario.check(config)
    return config


def _dropped(task: TaskConfig, drops: str | None) -> dict[str, Any]:
    """Settings of the task for bodies that were dropped so; they are not those of the training."""
    if drops is None:
        return OWN_POSES
    count = _FLAT_DROPS - (task.limp_drops == _FLAT_DROPS)
    return OWN_POSES | {"limp_share": 1.0, "limp_drops": count} | DROPPED[drops]


def _episode_count(config: Config, scenario: Scenario) -> int:
    """How many episodes: as many as asked for, or the default for the ground."""
    regions = 1 if config.terrain is None else len(REGIONS)
    curves = sum(len(read_curve_file(path).durations) for path in scenario.curves)
    return scenario.episodes or (curves or _EPISODES) * regions


def _evaluation_terrain(terrain: TerrainConfig | None, scenario: Scenario) -> TerrainConfig | None:
    """The ground of the training, or another one; rag-dolls fall anew in any case."""
    seed, ground = scenario.terrain_seed, scenario.ground
    if terrain is None:
        for name, given in (("--terrain-seed", seed), ("--ground", ground)):
            if given is not None:
                raise ConfigError(f"{name}: the policy was trained on a flat plane")
        return None
    if ground is not None:
        terrain = ground.put_into(terrain)
    if seed is not None and terrain.heights is not None:
        raise ConfigError(f"--terrain-seed: the ground is that of {terrain.heights}; leave it out")
    own = terrain.seed if seed is None else seed
    # another number of them falls otherwise than those of the training did
    return dataclasses.replace(terrain, seed=own, drops=_DROPS - (terrain.drops == _DROPS))


def description(loaded: LoadedPolicy, scenario: Scenario, episodes: Episodes) -> dict[str, Any]:
    """What the JSON file says beside the scores: the policy, the scenario and the rules."""
    env = episodes.task.environment
    task, terrain = env.config, env.terrain
    return {
        "policy": {"path": str(loaded.path), "seed": loaded.config.seed, **loaded.metadata},
        "conditions": {
            **dataclasses.asdict(scenario),
            "stand_time_s": task.stand_time_s,
            "engine": env.engine.name,
            "terrain_seed": None if terrain is None else terrain.seed,
            "pushed_episodes": int(episodes.trace.pushed.any(axis=0).sum()),
            "drop": None if scenario.drops is None else _drop(task),
        },
        "rules": {
            "success": {
                "last_s": LAST_S,
                "lowest_in_last_s": STAND_LOWEST,
                "mean_standing": STAND_MEAN,
            },
            "early_end": {
                "task_reward_below": task.terminate_reward,
                "head_gap_below_m": task.head_clearance_m,
                "longer_than_s": task.terminate_after_s,
            },
        },
    }


def _drop(task: TaskConfig) -> dict[str, Any]:
    ways = [dataclasses.asdict(drop) for drop in DROPS[task.drop_as]]
    return {"ways": ways, "fallen_share": task.fallen_share}


class Rate:
    """Shows episodes done, their rate and the time left; the first call, a compile, sets zero."""

    _PARTS = 20  # a terminal's bar moves, and elsewhere a line comes, this often

    def __init__(self, display: Display, episodes: int) -> None:
        self._display, self._episodes = display, episodes
        self._first: tuple[float, float] | None = None
        self._shown = 0

    def __call__(self, done: float) -> None:
        """Show that so many episodes are done."""
        now = time.monotonic()
        if self._first is None:
            self._first = (done, now)
            self._display.start(0)
        rate = (done - self._first[0]) / max(now - self._first[1], 1e-9)
        part = int(self._PARTS * done / self._episodes)
        if part > self._shown:
            self._display.update(int(done), rate, {})
            self._shown = part


def chosen_styles(config: Config, scenario: Scenario) -> Choice | None:
    """What makes the styles out of those of the training; None: they are the same."""
    if scenario.curves:
        files = [read_curve_file(path) for path in scenario.curves]
        return functools.partial(drawn, files)
    if scenario.motions is not None:
        return functools.partial(of_config, scenario.motions)
    if not scenario.blend:
        return None

    def mixtures(getups: Sequence[GetUp], character: CharacterSpec) -> tuple[GetUp, ...]:
        return blended(getups, character, config.task.curve_match_rad, scenario)

    return mixtures


def restore_policy(
    loaded: LoadedPolicy, task: BuiltTask | GetUpTask
) -> tuple[Learner, PolicyState]:
    """The learner of a task and the loaded policy in its form."""
    config = loaded.config
    environment = task.environment if isinstance(task, BuiltTask) else task
    learner = make_learner(
        environment, config.network, config.ppo, total_steps=config.train.total_steps
    )
    template = jax.eval_shape(learner.init_learner, jax.random.PRNGKey(0)).policy
    return learner, from_nested(template, loaded.policy, str(loaded.path))
