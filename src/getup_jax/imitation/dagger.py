"""DAgger warm start of composite motion: what comes next in the clips is learned before training.

A fresh actor holds the clips' mean pose. Each step of learning from there first ends fewer falls,
and a character that stands still falls least: it comes to rest in some pose of the clips, where the
discriminators have little to say against it, or it falls so soon that they are sure of everything.
So the actor is first taught, by regression, to name servo targets that lead to the clips' next
pose: in the states that it gets to itself when it starts on the clips (Ross et al. 2011, A
reduction of imitation learning ... to no-regret online learning). Where there are clips along
arcs, it learns to go on with the one that turns to the goal's target. Balance is left to training.

Over a meta policy it learns the clips that are new, and to leave the other hinges to that policy.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.envs.composite.build import BuiltComposite
from getup_jax.envs.composite.goals.combine import Goals
from getup_jax.envs.composite.task import CompositeTask, CompositeWorld
from getup_jax.imitation import action_regression
from getup_jax.networks import gaussian
from getup_jax.rl.actor_critic import normalized, observe
from getup_jax.rl.learner import Learner
from getup_jax.rl.state import PolicyState

Log = Callable[[str], None]

_ROUNDS = 4  # of playing and learning; in the first one the clips' own targets are played
_TURN_S = 1.0  # a target is so long away from straight ahead, at the turn rate that is learned
_LOOK_STEPS = 2  # a state is kept every so many steps
_EPOCHS, _MINIBATCH = 20, 256
_STD = 0.01  # weight of (log std - the first one)^2 beside the squared error (rad^2)


class Labelled(NamedTuple):
    """N states and what to do there."""

    observation: Any  # [N, O] raw
    action: Any  # [N, A]


@dataclasses.dataclass(frozen=True, eq=False)
class Setup:
    """What the actor is warmed up for."""

    built: BuiltComposite
    world: Any  # of the learner's environment: the task's, or with a meta policy
    new: np.ndarray | None = None  # [A] hinges that the meta policy does not know; None: no policy


def warm_start(
    learner: Learner, setup: Setup, policy: PolicyState, key: jax.Array, log: Log
) -> PolicyState:
    """The policy with an actor that goes on with the clips, and statistics of what it saw."""
    built = setup.built
    log("warm start: the actor learns what comes next in the clips ...")
    targets = clip_targets(built)
    parts: list[Labelled] = []
    before = math.nan
    for number, key_round in enumerate(jax.random.split(key, _ROUNDS)):
        key_play, key_order = jax.random.split(key_round)
        part = _play(learner, setup, policy, targets, key_play, own=number > 0)
        parts.append(part)
        if number == 0:
            policy = observe(policy, jnp.asarray(part.observation), learner.model.symmetry)
        before = _miss(learner, built.world, policy, part)
        everything = Labelled(*(np.concatenate(x) for x in zip(*parts, strict=True)))
        policy = _clone(learner, built.world, policy, everything, key_order)
    after = _miss(learner, built.world, policy, parts[-1])
    log(
        f"its servo targets miss those of the clips by {after:.1f} degrees (rms), {before:.1f} in "
        "the last states before it had learned from them"
    )
    return policy


def clip_targets(built: BuiltComposite) -> np.ndarray:
    """Servo targets [P, V, K - 1, J] (rad) that lead along the clips from every start.

    V: along which arc; NaN: past the clip.

    q(t + dt) + kd / kp dq/dt, since a PD servo with damping lags behind by kd / kp.
    """
    angles, task = built.following.angles, built.environment
    model = task.character.model
    lag = -model.actuator_biasprm[:, 2] / model.actuator_gainprm[:, 0]
    rate = np.diff(angles, axis=2) / task.engine.control_dt
    return angles[:, :, :-1] + lag * rate


def _play(
    learner: Learner,
    setup: Setup,
    policy: PolicyState,
    targets: np.ndarray,
    key: jax.Array,
    own: bool,
) -> Labelled:
    """States on the way from starts on the clips, by the actor's own actions or the clips'."""
    built, world = setup.built, setup.built.world
    env: Any = learner.env  # CompositeTask, or MetaTask around it
    std = learner.model.initial_std or learner.config.action_std[-1]
    key_row, key_start, key_noise, key_arc = jax.random.split(key, 4)
    row = jax.random.randint(key_row, (learner.config.num_envs,), 0, len(targets))
    arc = jax.random.randint(key_arc, row.shape, 0, targets.shape[1])
    state = _BEGIN(built.environment, env, world, setup.world, row, key_start)
    way = (targets[row, arc] - np.asarray(world.target_centre)) / np.asarray(world.target_scale)
    act = jax.jit(learner.act)
    goes_on = np.ones(len(row), bool)
    kept: list[Labelled] = []
    for step, key_step in enumerate(jax.random.split(key_noise, way.shape[1])):
        goes_on &= np.isfinite(way[:, step]).all(axis=-1)
        action = jnp.asarray(np.nan_to_num(way[:, step]), jnp.float32)
        if setup.new is None:
            bearing = _bearings(built.following.turns, np.asarray(arc), key_step)
            state = _TURN(env, setup.world, state, built.environment.goals, bearing)
        else:
            action = jnp.where(setup.new, action, state.observation[:, -env.action_size :])
        if step % _LOOK_STEPS == 0:
            seen = np.asarray(state.observation)[goes_on]
            kept.append(Labelled(seen, np.asarray(action)[goes_on]))
        if own:
            action = act(policy, state.observation)
        action = gaussian.sample(key_step, action, jnp.full_like(action, std))
        state, fell = _STEP(env, setup.world, state, action)
        goes_on &= ~np.asarray(fell)
    return Labelled(*(np.concatenate(x) for x in zip(*kept, strict=True)))


def _bearings(turns: np.ndarray, arc: np.ndarray, key: jax.Array) -> jax.Array:
    """Where targets [B] (rad) are for those who are to turn as the arcs [B] do.

    Proportional to the rate, anywhere between the neighbouring arcs' halves; behind the body for
    the fastest ones. With one arc alone: anywhere.
    """
    order = np.argsort(turns)
    inner = (turns[order][1:] + turns[order][:-1]) / 2 * _TURN_S
    low = np.concatenate([[-math.pi], inner])[np.argsort(order)]
    high = np.concatenate([inner, [math.pi]])[np.argsort(order)]
    return jax.random.uniform(key, arc.shape, minval=low[arc], maxval=high[arc])


def _begin(
    task: CompositeTask, env: Any, own: CompositeWorld, world: Any, row: jax.Array, key: jax.Array
) -> Any:
    """Episodes of `env` that start on the rows [B] of the clips; its task's world is `own`."""
    start = task.start(own, row, key)
    return env.adopt(world, start, start.goals, key)


_BEGIN = jax.jit(_begin, static_argnums=(0, 1))


def _turn(env: Any, world: Any, state: Any, goals: Goals, bearing: jax.Array) -> Any:
    """The episodes with their targets at the bearings [B] (rad)."""
    turned = goals.toward(env.goal_states(state), env.kinematics(state), bearing)
    return env.adopt(world, env.task_state(state), turned, state.key)


_TURN = jax.jit(_turn, static_argnums=(0, 3))


def _step(env: Any, world: Any, state: Any, action: jax.Array) -> tuple[Any, jax.Array]:
    state, output = env.advance(world, state, action)
    return state, output.terminated


_STEP = jax.jit(_step, static_argnums=0)


def _clone(
    learner: Learner,
    world: CompositeWorld,
    policy: PolicyState,
    seen: Labelled,
    key: jax.Array,
) -> PolicyState:
    """The policy after regression of its mean actions; its std stays near the first one."""
    first = math.log(learner.model.initial_std or 1.0)

    def loss(actor: Any, part: Labelled) -> tuple[jax.Array, dict[str, jax.Array]]:
        observation = normalized(policy, part.observation)
        mean, std = learner.model.distribution(actor, observation, jnp.ones(()))
        miss = jnp.mean(jnp.square(world.target_scale * (mean - part.action)))
        return miss + _STD * jnp.mean(jnp.square(jnp.log(std) - first)), {"miss": miss}

    actor = action_regression.regress(loss, policy.actor, seen, key, _EPOCHS, _MINIBATCH)
    return dataclasses.replace(policy, actor=actor)


def _miss(learner: Learner, world: CompositeWorld, policy: PolicyState, seen: Labelled) -> float:
    """How far its servo targets are from those of the clips (degrees, rms)."""
    action = jax.jit(learner.act)(policy, jnp.asarray(seen.observation))
    miss = jnp.mean(jnp.square(world.target_scale * (action - seen.action)))
    return math.degrees(math.sqrt(miss))
