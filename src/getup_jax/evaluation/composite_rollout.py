"""Episodes of a trained composite policy, all at once."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import Config
from getup_jax.core.types import Kinematics
from getup_jax.envs.composite.build import BuiltComposite
from getup_jax.envs.composite.meta.meta_policy import MetaTask
from getup_jax.envs.composite.task import CompositeTask
from getup_jax.physics.body_digest import warn_if_other
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.pytree_store import from_nested
from getup_jax.training.run import Job, Log, build_composite_job

FILMED = 3  # episodes whose goals are kept, for films


@dataclasses.dataclass(frozen=True, eq=False)
class CompositeEpisodes:
    """N episodes of T steps, played to their end whether the character fell or not."""

    position: np.ndarray  # [N, T, L, 3] of the links (m)
    quaternion: np.ndarray  # [N, T, L, 4]
    qpos: np.ndarray  # [N, T, 7 + J]
    fell: np.ndarray  # [N, T] bool, a fall or a failed simulation at this step
    goal_reward: np.ndarray  # [N, T, G] of the goal tasks
    goal_success: np.ndarray  # [N, G] share of the attempts that succeeded; NaN without attempts
    meta_weight: np.ndarray | None = None  # [N, T, A] w of equation 10; None: no meta policy
    shown: Shown | None = None  # of the first FILMED episodes


@dataclasses.dataclass(frozen=True, eq=False)
class Shown:
    """What the markers of goals are made of: pytrees of arrays [n, T, ...]."""

    goals: Any
    kinematics: Kinematics

    def at(self, episode: int, step: int) -> tuple[Any, Kinematics]:
        """The goals' states and the kinematics of one moment."""
        return jax.tree.map(lambda x: x[episode, step], (self.goals, self.kinematics))


@dataclasses.dataclass(frozen=True, eq=False)
class Restored:
    """A trained policy in its task."""

    built: BuiltComposite
    job: Job
    policy: Any  # PolicyState


def restore(config: Config, loaded: LoadedPolicy, log: Log) -> Restored:
    """The task of a config, and the loaded policy in it."""
    built, job = build_composite_job(config, log)
    warn_if_other(loaded.path, loaded.metadata, job.body, log)
    return Restored(built, job, policy_in(job, loaded))


def policy_in(job: Job, loaded: LoadedPolicy) -> Any:
    """The loaded policy as the job's learner has it."""
    template = jax.eval_shape(job.learner.init_learner, jax.random.PRNGKey(0)).policy
    return from_nested(template, loaded.policy, str(loaded.path))


def without_noise(env: Any) -> Any:
    """The environment; a meta policy, if it has one, acts with its mean, and has handed over."""
    if not isinstance(env, MetaTask):
        return env
    return dataclasses.replace(env, sample=False)


def task_of(env: Any) -> CompositeTask:
    """The environment without the meta policy around it."""
    return env.task if isinstance(env, MetaTask) else env


def make_player(job: Job, number: int) -> Any:
    """A jitted function (world, policy, key) to what `run_composite` returns, as arrays."""
    learner = job.learner
    env = without_noise(learner.env)
    task = task_of(env)
    steps = round(task.config.episode_s / task.engine.control_dt)
    first = len(task.groups)

    def play(world: Any, policy: Any, key: jax.Array) -> tuple[Any, ...]:
        state = env.init(world, key, number)

        def step(state: Any, _: None) -> tuple[Any, tuple[Any, ...]]:
            observation = state.observation
            action = learner.act(policy, observation)
            state, output = env.advance(world, state, action)
            seen = env.kinematics(state)
            kept = (seen.link_position, seen.link_quaternion, seen.qpos, output.terminated)
            weight = learner.meta_weight(policy, observation)
            weight = jnp.zeros((number, 0)) if weight is None else weight
            shown = jax.tree.map(lambda x: x[:FILMED], (env.goal_states(state), seen))
            return state, (*kept, output.reward[:, first:], weight, shown)

        state, found = jax.lax.scan(step, state, None, length=steps)
        shares = list(env.success(state).values())
        success = jnp.stack(shares, axis=-1) if shares else jnp.zeros((number, 0))
        *found, weight, shown = jax.tree.map(lambda x: jnp.swapaxes(x, 0, 1), found)
        return (*found, success, weight, shown)

    return jax.jit(play)


def run_composite(
    job: Job, policy: Any, number: int, seed: int, player: Any = None
) -> CompositeEpisodes:
    """Episodes from random starts with the mean action, and the mean one of a meta policy.

    `player`: of `make_player`, for several policies of one job without compiling anew.
    """
    player = player or make_player(job, number)
    found = player(jax.device_put(job.world), policy, jax.random.PRNGKey(seed))
    *found, weight, shown = jax.tree.map(np.asarray, found)
    weight = weight if weight.size else None
    return CompositeEpisodes(*found, meta_weight=weight, shown=Shown(*shown))
