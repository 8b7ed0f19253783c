"""Carries a trained policy over to another pose prior, so that other motions need no fresh start.

A policy acts by latent poses, and those of two priors have nothing to do with each other. What the
old policy means by an action is a servo target. The new prior has an action for it, too: the latent
that it encodes the old pose by, and offsets for what it cannot decode. So the old policy is run on
the new task under the old prior, and its actor is trained, by regression, to name its targets in
the units of the new one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp

from getup_jax import lessons
from getup_jax.algo import normalize
from getup_jax.algo.learner import Learner
from getup_jax.algo.state import PolicyState
from getup_jax.config import TaskConfig
from getup_jax.lessons import Lesson
from getup_jax.nets.prior import PosePrior
from getup_jax.tasks.actions import Units
from getup_jax.tasks.getup import GetUpTask, World

_ROLLOUTS = 24  # the last one is held out


def carry_over(
    learner: Learner,
    world: World,
    policy: PolicyState,
    task: TaskConfig,
    prior: PosePrior,
    key: jax.Array,
    log: Callable[[str], None],
) -> PolicyState:
    """The policy with an actor for the prior and the offsets of `learner` and `world`.

    Args:
        learner: of the new task.
        world: of the new task.
        policy: trained under `task` and `prior`.
        task: settings of the old task; what its actions mean.
        prior: of the old task.
        key: of the starts, the noise and the order of the minibatches.
        log: gets a line before and after.

    Returns the same policy where an action means the same under both.
    """
    env = learner.env
    assert isinstance(env, GetUpTask)
    assert world.prior is not None
    old = Units(prior, task.offset_scale)
    new = Units(world.prior, env.config.offset_scale)
    if old.same(new):
        return policy
    log("its pose prior or its offsets are others: teaching the actor those of this run ...")
    key_roll, key_order = jax.random.split(key)
    seen = _lessons(learner, env, world, policy, (old, new), key_roll)
    training, heldout = lessons.held_out(seen, len(seen.observation) // _ROLLOUTS)
    block = env.observer.slices()["action"]
    policy = dataclasses.replace(
        policy, statistics=_restated(policy.statistics, seen.observation, block)
    )
    before, _ = lessons.compare(learner, policy, new, heldout)
    policy = lessons.taught(learner, policy, new, training, key_order)
    after, offsets = lessons.compare(learner, policy, new, heldout)
    log(
        f"its servo targets differ by {after:.2f} degrees (rms) now, {before:.1f} before; "
        f"offsets |dq|_1 {offsets:.1f} rad"
    )
    return policy


def _lessons(
    learner: Learner,
    env: GetUpTask,
    world: World,
    policy: PolicyState,
    units: tuple[Units, Units],
    key: jax.Array,
) -> Lesson:
    """What the old policy does on the new task."""
    (old, new), block = units, env.observer.slices()["action"]
    config = dataclasses.replace(env.config, offset_scale=old.offset_scale, paths=None)
    env = dataclasses.replace(env, config=config)
    world = world.replace(prior=old.prior, pool=world.pool.replace(action=None))

    def lesson(observation: jax.Array) -> Lesson:
        condition = env.observer.condition(observation)
        mean = learner.act(policy, observation)
        seen = old.translate(observation[..., block], condition, new)
        return Lesson(
            observation=observation.at[..., block].set(seen),
            action=old.translate(mean, condition, new),
            target=old.target(mean, condition),
            condition=condition,
        )

    return lessons.watched(learner, env, world, policy, lesson, _ROLLOUTS, key)


def _restated(
    statistics: normalize.Moments | None, observation: jax.Array, block: slice
) -> normalize.Moments | None:
    """The statistics, those of the observation's action [N, O] in the new units."""
    if statistics is None:
        return None
    fresh = normalize.moments_of(observation, jnp.mean(observation, axis=0))
    return statistics.replace(
        **{
            name: getattr(statistics, name).at[block].set(getattr(fresh, name)[block])
            for name in ("mean", "residue", "variance")
        }
    )
