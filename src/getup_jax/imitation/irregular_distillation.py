"""Brings a policy of the plane and one of irregular ground together in one, before it trains there.

To learn slopes from a policy that knows only the plane takes tens of millions of steps, and where
another policy has made them, they need not be made again: each of the two teaches the new one on
the ground that it knows (policy distillation from several teachers, Rusu et al. 2016), in the
states that the new one gets to itself (DAgger, Ross et al. 2011). It begins with the weights of the
first, as if the map were even.
"""

from __future__ import annotations

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.envs.getup import rewards
from getup_jax.envs.getup.task import GetUpTask, World
from getup_jax.imitation import action_regression
from getup_jax.imitation.action_distillation import Teacher
from getup_jax.imitation.action_regression import Demonstrations, Log
from getup_jax.imitation.slope_warm_start import as_if_even, everywhere, on_the_flat
from getup_jax.rl.learner import Learner
from getup_jax.rl.state import PolicyState

_ROUNDS = 10
_SAMPLES = 150_000  # at least, of each round, and of the plane alone; the last rollout is held out
_WINDOW = 3  # rounds whose samples are learned from, beside those of the plane
_EPOCHS, _LAST_EPOCHS = 2, 8  # of a round, and of the last one: new states teach more than old ones
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
    demonstrate = functools.partial(_demonstrate, learner, world, policy, teacher)
    plane, anywhere = on_the_flat(env), _on_library_curves(everywhere(env))
    rollouts = 1 + math.ceil(_SAMPLES / (learner.config.num_envs * learner.config.num_steps))
    collect = functools.partial(action_regression.collect, learner)

    def as_taught(observation: jax.Array) -> jax.Array:
        return demonstrate(observation).action

    key_plane, *keys = jax.random.split(key, 1 + _ROUNDS)
    flat = collect(plane, world, as_taught, demonstrate, rollouts, key_plane)
    flat, flat_heldout = action_regression.split(flat, len(flat.observation) // rollouts)
    act, decoder = as_taught, env.decoder(world)
    seen: list[Demonstrations] = []
    for number, key_round in enumerate(keys, start=1):
        key_roll, key_order = jax.random.split(key_round)
        part = collect(anywhere, world, act, demonstrate, rollouts, key_roll)
        parts = action_regression.split(part, len(part.observation) // rollouts)
        training, heldout = (_that_follow(env, demos) for demos in parts)
        seen = [*seen[1 - _WINDOW :], training]
        before, _ = action_regression.compare(learner, policy, decoder, heldout)
        demos = action_regression.join([flat, *seen])
        epochs = _LAST_EPOCHS if number == _ROUNDS else _EPOCHS
        policy = action_regression.clone(learner, policy, decoder, demos, key_order, epochs)
        after, _ = action_regression.compare(learner, policy, decoder, heldout)
        on_plane, _ = action_regression.compare(learner, policy, decoder, flat_heldout)
        log(
            f"round {number} of {_ROUNDS}: its servo targets differ by {after:.2f} degrees (rms) "
            f"now, {before:.1f} before, and on the plane by {on_plane:.2f}"
        )
        act = functools.partial(learner.act, policy)
    return policy


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
