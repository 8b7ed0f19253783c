"""Teaches a policy that knows only flat ground to stand on slopes, before it trains there.

On a plane the height map says one number 25 times, and feet are never turned to the ground: PPO has
to find what the map's differences mean while every standing start falls within a second. Standing
starts on irregular ground have soles on the slope, and hold that pose for a second under their own
servos. So the actor is taught, by regression, to name that pose there, what it did before on the
flat, and, while it rises from slopes, what it would do if the map were even, but for one thing.
Motions that start prone have raised the head before it counts as lying on the floor [P 5.3]; limp
bodies that came to rest face down have not, and a policy that trained on motions moves their arms
first. So there the neck is stretched while the curve still lies.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.envs.getup.episode import STANDING, EpisodeState
from getup_jax.envs.getup.task import GetUpTask, World
from getup_jax.imitation import action_regression, demonstrations
from getup_jax.imitation.demonstrations import Demonstrations, Log
from getup_jax.rl.learner import Learner
from getup_jax.rl.state import PolicyState

# rollouts of the policy on the flat and on slopes, and batches of poses that are held
_OWN, _RISING, _HELD = 6, 4, 8
_HOLD_STEPS, _LOOK_STEPS = 60, 3  # how long they are, and how often one is taken as a demonstration
_PUSH, _PUSH_STEPS = 0.3, 20  # standard deviation of all actions, kept for so many steps
_FLAT_ONLY = {"curriculum": "success", "unlock_successes": 10**9}  # nothing else opens
_ALL_OPEN = {"curriculum": "none"}
_RISES = 0.6  # share of a standing curve's height up to which it rises, and what it did is kept
_LIES_M, _PRONE_RAD = 0.2, 2.2  # a curve that lies is lower, one that faces down has more
_STRETCHED = ("neck_flex", "head_flex")  # to their lower limits
_SUNK_M = 0.1  # of the neck: from there on it falls


def warm_start_on_slopes(
    learner: Learner, world: World, policy: PolicyState, key: jax.Array, log: Log
) -> PolicyState:
    """The policy with an actor that turns its feet to the slope where it stands."""
    env = learner.env
    assert isinstance(env, GetUpTask)
    decoder = env.decoder(world)
    log("it has trained on a plane: teaching it to stand on slopes ...")
    keys = jax.random.split(key, _HELD + 3)
    as_it_is = functools.partial(as_if_even, learner, world, policy)
    act = functools.partial(learner.act, policy)
    own = demonstrations.collect(learner, on_the_flat(env), world, act, as_it_is, _OWN, keys[0])
    anywhere = everywhere(env)
    stretched = _stretched(env)

    def head_up(observation: jax.Array) -> Demonstrations:
        demos = as_it_is(observation)
        return demos.replace(target=stretched(demos.target, demos.condition))

    rising = demonstrations.collect(learner, anywhere, world, act, head_up, _RISING, keys[2])
    low = np.asarray(rising.condition[:, 0]) < _RISES * float(np.max(world.points[:, -1, 0]))
    rising = jax.tree.map(lambda x: x[low], rising)
    held = [_held(learner, env, world, k) for k in keys[3:]]
    training = demonstrations.join([own, rising, *held[:-1]])
    before, _ = action_regression.compare(learner, policy, decoder, held[-1])
    policy = action_regression.clone(learner, policy, decoder, training, keys[1])
    after, _ = action_regression.compare(learner, policy, decoder, held[-1])
    flat, slope = (action_regression.compare(learner, policy, decoder, x)[0] for x in (own, rising))
    log(
        f"its servo targets on slopes miss the held pose by {after:.2f} degrees (rms), "
        f"{before:.1f} before; they moved by {flat:.2f} on the flat, by {slope:.2f} rising from "
        "slopes"
    )
    return policy


def on_the_flat(env: GetUpTask) -> GetUpTask:
    """The task on irregular ground, of which the flat region alone is open."""
    assert env.terrain is not None
    return env.with_terrain(dataclasses.replace(env.terrain, **_FLAT_ONLY))


def everywhere(env: GetUpTask) -> GetUpTask:
    """The task on irregular ground with all regions open."""
    assert env.terrain is not None
    return env.with_terrain(dataclasses.replace(env.terrain, **_ALL_OPEN))


def as_if_even(
    learner: Learner, world: World, policy: PolicyState, observation: jax.Array
) -> Demonstrations:
    """What the policy would do if the map were even, for raw observations [N, O]."""
    env = learner.env
    assert isinstance(env, GetUpTask)
    condition = env.observer.condition(observation)
    action = learner.act(policy, env.observer.evened(observation))
    target = env.decoder(world).target(action, condition)
    return Demonstrations(observation, action, target, condition)


def _stretched(env: GetUpTask) -> Callable[[jax.Array, jax.Array], jax.Array]:
    """Targets [N, J] with the neck stretched where the curve values [N, 3] lie face down."""
    hinges = jnp.asarray([env.character.joint(name) for name in _STRETCHED])
    limits = jnp.asarray(env.character.joint_lower, jnp.float32)[hinges]

    def stretched(target: jax.Array, condition: jax.Array) -> jax.Array:
        lies = (condition[:, 0] < _LIES_M) & (condition[:, 2] > _PRONE_RAD)
        return target.at[:, hinges].set(jnp.where(lies[:, None], limits, target[:, hinges]))

    return stretched


def _held(learner: Learner, env: GetUpTask, world: World, key: jax.Array) -> Demonstrations:
    """Standing poses on irregular ground, swaying as their servo targets are pushed about."""
    observation, action = jax.device_get(_sway(learner.config.num_envs, env, world, key))
    height = observation[..., env.observer.slices()["features"]][..., 0]
    stands = np.abs(height - height[:1]) < _SUNK_M
    observation, action = jnp.asarray(observation[stands]), jnp.asarray(action[stands])
    return _demonstrate(env, world, observation, action)


@functools.partial(jax.jit, static_argnums=0)
def _demonstrate(
    env: GetUpTask, world: World, observation: jax.Array, action: jax.Array
) -> Demonstrations:
    condition = env.observer.condition(observation)
    return Demonstrations(
        observation, action, env.decoder(world).target(action, condition), condition
    )


def _sway(size: int, env: GetUpTask, world: World, key: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Observations [T, B, O], and the actions [T, B, A] that hold the pose of the start."""
    _, regions, styles, rows = world.pool.table.shape
    keys = jax.random.split(key, 4)
    style = jax.random.randint(keys[0], (size,), 0, styles)
    row = jax.random.randint(keys[1], (size,), 0, rows)
    region = jax.random.randint(keys[2], (size,), 1, regions)
    state = _start(env, world, style, row, region)
    hold, push, seen = state.action, jnp.zeros_like(state.action), []
    for index, key_push in enumerate(jax.random.split(keys[3], _HOLD_STEPS)):
        if index % _PUSH_STEPS == 0:
            push = _PUSH * jax.random.normal(key_push, hold.shape)
        if index % _LOOK_STEPS == 0:
            seen.append(state.observation)
        state = _step(env, world, state, hold + push)
    return jnp.stack(seen), jnp.broadcast_to(hold, (len(seen), *hold.shape))


@functools.partial(jax.jit, static_argnums=0)
def _start(
    env: GetUpTask, world: World, style: jax.Array, row: jax.Array, region: jax.Array
) -> EpisodeState:
    return env.start(world, style, jnp.full_like(row, STANDING), row, region=region)


@functools.partial(jax.jit, static_argnums=0)
def _step(env: GetUpTask, world: World, state: EpisodeState, action: jax.Array) -> EpisodeState:
    return env.advance(world, state, action)[0]
