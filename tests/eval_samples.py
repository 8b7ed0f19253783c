"""Episodes of the tiny task with an untrained policy, for the tests of evaluation."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from tiny_task import CONFIG, tiny_task

from compiled import first_policy
from getup_jax.config import Config, NetworkConfig
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.evaluation.rollout import Episodes, run_episodes
from getup_jax.evaluation.scenario import Scenario, make_plan
from getup_jax.physics.body_digest import body_digest
from getup_jax.physics.character import load_character
from getup_jax.pose_prior.prior import to_dict
from getup_jax.rl.learner import Learner, make_learner
from getup_jax.rl.state import PolicyState
from getup_jax.runtime.checkpoint import CHECKPOINTS, save_learner

SMALL = dataclasses.replace(
    CONFIG,
    network=NetworkConfig(hidden_sizes=(8,)),
    task=dataclasses.replace(CONFIG.task, stand_time_s=1.5, stand_start=1.0),
    curriculum=None,
)


def make_task(config: Config = SMALL) -> BuiltTask:
    return tiny_task(load_character(config.physics), config)


def make_policy(task: BuiltTask, config: Config = SMALL) -> tuple[Learner, PolicyState]:
    learner = make_learner(
        task.environment, config.network, config.ppo, total_steps=config.train.total_steps
    )
    return learner, first_policy(learner)


def run(task: BuiltTask, conditions: Scenario, number: int) -> Episodes:
    learner, policy = make_policy(task)
    *_, styles, rows = task.world.pool.table.shape
    plan = make_plan(conditions, number, styles, rows)
    return run_episodes(task, learner, policy, plan, lambda _: None)


def save_policy(
    folder: Path,
    task: BuiltTask,
    config: Config = SMALL,
    iteration: int = 3,
    body: dict[str, str] | None = None,
) -> Path:
    """A run folder with one checkpoint of an untrained policy, of the task's body by default."""
    _, policy = make_policy(task, config)
    item = {"policy": policy, "prior": to_dict(task.prior)}
    body = body or body_digest(task.environment.character.model)
    metadata = {"steps": 100 * iteration, "body": body}
    save_learner(folder / CHECKPOINTS, iteration, policy, config, item, metadata)
    return folder
