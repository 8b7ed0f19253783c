"""The front door in Python: policies, environments, training and evaluation by name.

    import getup_jax as gj

    policy = gj.load_policy("getup")
    env = gj.make_env(policy, num_envs=64)
    state = env.reset(seed=0)
    for _ in range(300):
        state, output = env.step(state, policy.act(state.observation))

See docs/python.md. Everything here is also in the rooms below, in parts that can be put together in
other ways.
"""

from __future__ import annotations

import dataclasses
import functools
import numbers
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax

from getup_jax.config import Config, ConfigError
from getup_jax.config.load import load_config as _load_config
from getup_jax.core.resources import DEFAULT_POLICY
from getup_jax.core.types import StepOutput
from getup_jax.envs.composite.goals.combine import register_goal as register_goal
from getup_jax.envs.composite.goals.goal import Goal as Goal
from getup_jax.envs.composite.goals.goal import GoalOutput as GoalOutput
from getup_jax.envs.getup.build import build_task
from getup_jax.envs.getup.user_rewards import REWARDS, RewardTerm
from getup_jax.evaluation import composite_rollout, driver, getup
from getup_jax.evaluation.composite import CompositeScores
from getup_jax.evaluation.metrics import Scores
from getup_jax.evaluation.scenario import Scenario
from getup_jax.functional import Functional, make_functional
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.pose_prior.prior import PosePrior
from getup_jax.runtime import checkpoint
from getup_jax.runtime.console import Display
from getup_jax.training import run as _run

Log = Callable[[str], None]


def register_reward(name: str) -> Callable[[RewardTerm], RewardTerm]:
    """A decorator that makes a reward term of getting up known to `task.rewards`.

    The term is a pure function of `RewardInputs` to [B] in [0, 1]. Commands know it where a package
    has it as an entry point of the group `getup_jax.rewards`. Raises ConfigError where the name is
    taken.
    """

    def register(term: RewardTerm) -> RewardTerm:
        REWARDS.register(name, term)
        return term

    return register


def _silent(text: str) -> None:
    """Say nothing."""


@dataclasses.dataclass(frozen=True, eq=False)
class Policy:
    """A trained policy, without noise."""

    config: Config  # that it was trained with
    loaded: checkpoint.LoadedPolicy

    @property
    def name(self) -> str:
        """Where it was loaded from."""
        return str(self.loaded.path)

    @property
    def steps(self) -> int:
        """Control steps of its training."""
        return int(self.loaded.metadata.get("steps", 0))

    def act(self, observation: jax.Array) -> jax.Array:
        """Mean actions [N, A] for raw observations [N, O]."""
        return self._act(observation)

    @functools.cached_property
    def _act(self) -> Callable[[jax.Array], jax.Array]:
        if self.config.composite_motion:
            found = composite_rollout.restore(self.config, self.loaded, _silent)
            return jax.jit(functools.partial(found.job.learner.act, found.policy))
        config = getup.evaluation_config(self.config, Scenario(episodes=1))
        task = build_task(config, _silent, self.prior)
        learner, policy = getup.restore_policy(self.loaded, task)
        return jax.jit(functools.partial(learner.act, policy))

    @property
    def prior(self) -> PosePrior | None:
        """What its latent actions mean; None: they are servo targets."""
        return pose_prior.from_checkpoint(self.loaded.prior)


@dataclasses.dataclass(frozen=True, eq=False)
class Env:
    """A batch of episodes that start anew by themselves; its steps are compiled once."""

    config: Config
    num_envs: int
    environment: Any  # pure functions of the world and the state, see core/types.py
    world: Any  # the arrays that all episodes share
    styles: tuple[str, ...]  # the get-ups that it follows, in the order of `state.getup`

    @property
    def observation_size(self) -> int:
        """O."""
        return int(self.environment.observation_size)

    @property
    def action_size(self) -> int:
        """A."""
        return int(self.environment.action_size)

    @property
    def control_dt(self) -> float:
        """Seconds of a step."""
        return float(composite_rollout.task_of(self.environment).engine.control_dt)

    def reset(self, seed: int = 0) -> Any:
        """The first state of all episodes; `state.observation` is [num_envs, O]."""
        return self._reset(self.world, jax.random.PRNGKey(seed))

    def step(self, state: Any, action: jax.Array) -> tuple[Any, StepOutput]:
        """The next state after actions [num_envs, A], and what came of it; see `StepOutput`."""
        return self._step(self.world, state, action)

    def functional(self) -> Functional:
        """(reset, step) as pure functions of `world`, for training loops of one's own."""
        return make_functional(self.config, self.environment, self.num_envs)

    @functools.cached_property
    def _reset(self) -> Callable[[Any, jax.Array], Any]:
        return jax.jit(lambda world, key: self.environment.init(world, key, self.num_envs))

    @functools.cached_property
    def _step(self) -> Callable[[Any, Any, jax.Array], tuple[Any, StepOutput]]:
        return jax.jit(self.environment.step)


def load_config(source: str | Path, *overrides: str) -> Config:
    """The config of a YAML file or of a shipped name, with `section.key=value` overrides.

    Raises ConfigError that says what is wrong, in one line.
    """
    return _load_config(source, overrides)


def load_policy(source: str | Path = DEFAULT_POLICY) -> Policy:
    """The policy of a run folder, a checkpoint, an exported policy, or the name of a shipped one.

    Raises CheckpointError that says what is wrong, in one line.
    """
    loaded = checkpoint.load_policy(source)
    return Policy(loaded.config, loaded)


def make_env(
    source: Policy | Config | str | Path,
    num_envs: int = 1,
    scenario: Scenario | None = None,
    training: bool = False,
    log: Log = _silent,
) -> Env:
    """Episodes of a policy's or a config's task.

    Args:
        source: a policy, whose pose prior the actions are then in; a config, or the name of one.
        num_envs: how many episodes go on at once.
        scenario: how episodes begin; by default as `getup-eval` has them: whole ones, lying.
        training: episodes as a training has them, with starts on the way, ends that come early and
            help; not with a scenario.
        log: gets a line for each step of building it.

    Raises ConfigError for what is not possible.
    """
    if not isinstance(num_envs, numbers.Integral) or num_envs < 1:
        raise ConfigError(f"num_envs: expected a whole number of at least 1, got {num_envs!r}")
    _check_kind("training", training, bool, "True or False")
    _check_kind("scenario", scenario, Scenario | None, "a getup_jax.Scenario")
    _check_kind("config", source, Policy | Config | str | Path, "a config, a policy, or a name")
    if training and scenario is not None:
        raise ConfigError("make_env: expected a scenario or training=True, got both")
    prior = None
    if isinstance(source, Policy):
        config, prior = source.config, source.prior
    else:
        config = source if isinstance(source, Config) else load_config(source)
    if config.composite_motion:
        if scenario is not None:
            raise ConfigError("scenario: only for getting up, this config is of composite motion")
        job = _run.build_job(config, log)
        return Env(config, num_envs, job.learner.env, job.world, ())
    if not training:
        config = getup.evaluation_config(config, scenario or Scenario())
    built = build_task(config, log, prior, getup.chosen_styles(config, scenario or Scenario()))
    styles = tuple(style.name for style in built.getups)
    return Env(config, num_envs, built.environment, built.world, styles)


def _check_kind(name: str, value: object, kind: Any, expected: str) -> None:
    if not isinstance(value, kind):
        raise ConfigError(f"{name}: expected {expected}, got {value!r}")


def train(
    config: Config, run_folder: str | Path, resume: bool = False, quiet: bool = False
) -> Policy:
    """Train until `train.total_steps`, and give the policy; Ctrl-C saves and gives what is there.

    Args:
        config: of `load_config`.
        run_folder: gets config.yaml, metrics.jsonl and checkpoints/.
        resume: go on from the folder's newest checkpoint, where it has one.
        quiet: print nothing.

    Raises RunError, CheckpointError and TrainingError with texts for the user.
    """
    _run.run(config, run_folder, resume=resume, quiet=quiet)
    return load_policy(run_folder)


def evaluate(
    policy: Policy | str | Path, scenario: Scenario | None = None, quiet: bool = True
) -> Scores | CompositeScores:
    """What `getup-eval` says about a policy.

    `Scores` of one that gets up: success, errors, how the motion feels. `CompositeScores` of one of
    composite motion: imitation by group, goals, falls. Raises ConfigError for what it cannot be
    asked.
    """
    policy = policy if isinstance(policy, Policy) else load_policy(policy)
    scenario = scenario or Scenario()
    number = driver.episode_count(policy.loaded, scenario)
    with Display(number, quiet, unit="episodes") as display:
        return driver.evaluate(policy.loaded, scenario, display).scores
