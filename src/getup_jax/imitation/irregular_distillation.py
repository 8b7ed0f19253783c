"""Brings a policy of the plane and one of irregular ground together in one, before it trains there.

To learn slopes from a policy that knows only the plane takes tens of millions of steps, and where
another policy has made them, they need not be made again: each of the two teaches the new one on
the ground that it knows (policy distillation from several teachers, Rusu et al. 2016), in the
states that the new one gets to itself (DAgger, Ross et al. 2011). It begins with the weights of the
first, as if the map were even. Networks that are mirror-equivariant cannot follow a teacher that is
not: they learn the mean of what it does in a state and the image of what it does in its image.
"""

from __future__ import annotations

import collections
import dataclasses
import functools
import math
import time

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.envs.getup import rewards
from getup_jax.envs.getup.task import GetUpTask, World
from getup_jax.imitation import action_regression
from getup_jax.imitation.action_distillation import Teacher
from getup_jax.imitation.demonstrations import Collector, Demonstrations, Log
from getup_jax.imitation.incremental_regression import IncrementalRegression
from getup_jax.imitation.slope_warm_start import as_if_even, everywhere, on_the_flat
from getup_jax.rl.learner import Learner
from getup_jax.rl.state import PolicyState
from getup_jax.runtime.console import duration

_ROUNDS = 40
_UPDATES = 500  # of a round
_SAMPLES, _ON_PLANE = 90_000, 30_000  # of a round: anywhere, and of the plane alone
_KEPT = 9  # rounds whose samples are learned from
_FOLLOWS = 0.3  # r_h r_theta; further off, no teacher knows what to do, and all are told otherwise
_EVEN_M = 1e-3  # differences within the height map, which rounding makes, too


def distill_on_irregular(
    learner: Learner,
    world: World,
    policy: PolicyState,
    teacher: Teacher,
    key: jax.Array,
    log: Log,
) -> PolicyState:
    """The policy, with an actor that does on irregular ground what the teacher does there.

    Args:
        learner: of the new run, on irregular ground.
        world: of the new run.
        policy: of the new run, from one that knows a plane alone.
        teacher: a policy that was trained on irregular ground.
        key: of the starts, the noise and which samples are learned from.
        log: gets a line for each round.
    """
    env = learner.env
    assert isinstance(env, GetUpTask)
    log("it has trained on a plane: distilling what the other one does on irregular ground ...")
    if learner.model.symmetry is not None and teacher.model.symmetry is None:
        log(
            "warning: the other one is not mirror-equivariant, and networks that are cannot follow "
            "it; network.mirror=false can"
        )
    demonstrate = functools.partial(_demonstrate, learner, world, policy, teacher)
    decoder = env.decoder(world)
    key_rounds, key_samples, *keys = jax.random.split(key, 4)
    tasks = _on_library_curves(everywhere(env)), on_the_flat(env)
    anywhere, plane = (
        Collector(learner, task, world, learner.act, demonstrate, key_start)
        for task, key_start in zip(tasks, keys, strict=True)
    )
    rng = np.random.default_rng(np.asarray(jax.random.key_data(key_samples)))
    regression = IncrementalRegression(learner, policy, decoder, _ROUNDS * _UPDATES)
    seen: collections.deque[Demonstrations] = collections.deque(maxlen=2 * _KEPT)
    begin = time.monotonic()
    for number in range(_ROUNDS + 1):  # the last one is for the numbers alone
        misses = []
        key_anywhere, key_plane = jax.random.split(jax.random.fold_in(key_rounds, number))
        for collector, samples, key_roll in (
            (anywhere, _SAMPLES, key_anywhere),
            (plane, _ON_PLANE, key_plane),
        ):
            part = _new(learner, collector, regression.policy, samples, key_roll, rng)
            misses.append(action_regression.compare(learner, regression.policy, decoder, part)[0])
            seen.append(_that_follow(env, part))
        log(
            f"after {number} of {_ROUNDS} rounds its servo targets differ by {misses[0]:.2f} "
            f"degrees (rms) in its own states, on the plane by {misses[1]:.2f}"
            + _time_left(time.monotonic() - begin, number)
        )
        if number < _ROUNDS:
            regression.learn(seen, _UPDATES, rng)
    return regression.policy


def _new(
    learner: Learner,
    collector: Collector,
    policy: PolicyState,
    samples: int,
    key: jax.Array,
    rng: np.random.Generator,
) -> Demonstrations:
    """So many, drawn from as many whole rollouts as they need."""
    steps = learner.config.num_envs * learner.config.num_steps
    part = collector.collect(policy, jax.random.split(key, math.ceil(samples / steps)))
    kept = rng.choice(len(part.target), samples, replace=False)
    return jax.tree.map(lambda x: x[kept], part)


def _time_left(seconds: float, done: int) -> str:
    if not 0 < done < _ROUNDS:
        return ""
    return f"; about {duration(seconds / done * (_ROUNDS - done))} left"


def _on_library_curves(env: GetUpTask) -> GetUpTask:
    """The task without drawn curves, which the policies of irregular ground have not seen."""
    config = dataclasses.replace(env.curriculum.config, drawn_curves=0.0)
    return dataclasses.replace(env, curriculum=dataclasses.replace(env.curriculum, config=config))


def _that_follow(env: GetUpTask, demos: Demonstrations) -> Demonstrations:
    """Those of bodies that are near their curves."""
    value = demos.observation[:, env.observer.slices()["features"]]
    near_height = rewards.height(value[:, 0], demos.condition[:, 0])
    near_angles = rewards.orientation(value[:, 1:], demos.condition[:, 1:])
    near = np.asarray(near_height * near_angles > _FOLLOWS)
    return jax.tree.map(lambda x: x[near], demos)


def _demonstrate(
    learner: Learner, world: World, own: PolicyState, teacher: Teacher, observation: jax.Array
) -> Demonstrations:
    """What the two would do, each on its ground, for raw observations [N, O] of the new run."""
    env = learner.env
    assert isinstance(env, GetUpTask)
    here = as_if_even(learner, world, own, observation)
    there = teacher.demonstrate(env, env.decoder(world), observation)
    bumps = jnp.abs(env.observer.evened(observation) - observation)
    irregular = jnp.any(bumps > _EVEN_M, axis=-1)
    return jax.tree.map(lambda a, b: jnp.where(irregular[:, None], a, b), there, here)
