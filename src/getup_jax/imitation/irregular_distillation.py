"""Brings a policy of the plane and one of irregular ground together in one, before it trains there.

To learn slopes from a policy that knows only the plane takes tens of millions of steps, and where
another policy has made them, they need not be made again: each of the two teaches the new one on
the ground that it knows (policy distillation from several teachers, Rusu et al. 2016), in the
states that the new one gets to itself (DAgger, Ross et al. 2011). It begins with the weights of the
first, as if the map were even. Networks that are mirror-equivariant cannot follow a teacher that is
not: what it does left and right, they would do half of at once.
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
from getup_jax.imitation.action_regression import Cloning, Collector, Demonstrations, Log
from getup_jax.imitation.slope_warm_start import as_if_even, everywhere, on_the_flat
from getup_jax.rl.learner import Learner
from getup_jax.rl.state import PolicyState
from getup_jax.runtime.console import duration

_ROUNDS = 40
_SAMPLES, _ON_PLANE = 90_000, 30_000  # of a round, at least: anywhere, and of the plane alone
_KEPT = 9  # rounds whose samples are learned from
_UPDATES = 500  # of a round
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
        key: of the starts, the noise and the order of the minibatches.
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
    key_order, *keys = jax.random.split(key, 3)
    tasks = _on_library_curves(everywhere(env)), on_the_flat(env)
    collectors = [
        Collector(learner, task, world, learner.act, demonstrate, key_start)
        for task, key_start in zip(tasks, keys, strict=True)
    ]
    steps = learner.config.num_envs * learner.config.num_steps
    rollouts = [math.ceil(samples / steps) for samples in (_SAMPLES, _ON_PLANE)]
    rng = np.random.default_rng(int(jax.random.randint(key_order, (), 0, 2**31 - 1)))
    cloning = Cloning(learner, policy, env.decoder(world), _ROUNDS * _UPDATES)
    seen: collections.deque[Demonstrations] = collections.deque(maxlen=2 * _KEPT)
    begin = time.monotonic()
    for number in range(_ROUNDS + 1):  # the last one is for the numbers alone
        parts = [
            _that_follow(env, collector.collect(cloning.policy, jax.random.split(key_round, count)))
            for collector, count, key_round in zip(
                collectors, rollouts, jax.random.split(jax.random.fold_in(key, number)), strict=True
            )
        ]
        miss, on_plane = (
            action_regression.compare(learner, cloning.policy, env.decoder(world), part)[0]
            for part in parts
        )
        left = (time.monotonic() - begin) / max(number, 1) * (_ROUNDS - number)
        log(
            f"after {number} of {_ROUNDS} rounds its servo targets differ by {miss:.2f} degrees "
            f"(rms) in its own states, on the plane by {on_plane:.2f}"
            + (f"; {duration(left)} left" if 0 < number < _ROUNDS else "")
        )
        if number < _ROUNDS:
            seen.extend(parts)
            cloning.learn(seen, _UPDATES, rng)
    return cloning.policy


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
