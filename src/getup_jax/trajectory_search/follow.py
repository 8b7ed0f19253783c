"""How closely a body can follow a curve: a search around what a policy does.

Many copies of the body act as the policy does, and beside it with noise that lasts. Those that are
nearest to the curves over a look-ahead, at the price of equation 3 for offsets, go on. So what the
search follows is within the physics and the actions of the policy, if not within its knowledge. It
is greedy: where it gets lost, nothing says that the curve cannot be followed.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from getup_jax.core.types import take
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.envs.getup.drawn_curves import Curve
from getup_jax.envs.getup.episode import LYING, STAND_LOWEST, EpisodeState
from getup_jax.envs.getup.task import GetUpTask, World
from getup_jax.evaluation.control_gain import ControlGain, curves_of, gain_of, of_values
from getup_jax.evaluation.rollout import Progress, plan_curves
from getup_jax.evaluation.scenario import Plan
from getup_jax.motion.getup.curve_alignment import FEATURE_SCALE
from getup_jax.rl.learner import Learner
from getup_jax.trajectory_search.sampling import Sampler

PARENTS = 32  # K
CHILDREN = 512  # B
WINDOW = 3  # control steps of which the fittest go on
AHEAD = 24  # control steps that decide which these are: .8 s
SPREAD_RAD = 0.15  # largest standard deviation of a hinge's noise
_LASTS = 0.9  # share of a parent's noise that its children keep
_TAMEST = -3.0  # beside a policy that knows the way, small changes matter
_FAILED = 1e3  # cost of a step that is not finite
_ENDED = 50.0  # of a look-ahead in which an episode ends early
_AFTER_S = 0.5  # the search goes on so long after the curve's end


@struct.dataclass
class Population:
    """K episodes that go on."""

    state: EpisodeState  # rows; without key
    push: jax.Array  # [K, A] what is added to the policy's action
    score: jax.Array  # [K] the lower, the better


@struct.dataclass
class Steps:
    """Control steps of episodes; leaves [W, K, ...]."""

    features: Any  # [W, K, 3]
    target: Any  # [W, K, 3]
    time: Any  # [W, K] s


@dataclasses.dataclass(frozen=True, eq=False)
class Follower:
    """The search; `act` gives actions [B, A] for observations [B, O]."""

    env: GetUpTask
    act: Callable[[jax.Array], jax.Array]

    def start(self, world: World, getup: jax.Array, row: jax.Array, curve: Curve) -> Population:
        """One start K times; getup and row are [K], and so is the curve."""
        kind = jnp.full(PARENTS, LYING, jnp.int32)
        state = self.env.start(world, getup, kind, row, curve)
        none = jnp.zeros((PARENTS, self.env.action_size))
        return Population(state.replace(key=None), none, jnp.zeros(PARENTS))

    def window(
        self, world: World, population: Population, key: jax.Array
    ) -> tuple[Population, jax.Array, Steps]:
        """The population after WINDOW steps, their parents' numbers [K] and the steps."""
        sampler = Sampler(self.env, PARENTS, CHILDREN)
        parent = jnp.arange(CHILDREN) % PARENTS
        before = population.push[parent]
        push = _LASTS * before + sampler.noise(SPREAD_RAD, key, _TAMEST)
        second = jnp.arange(CHILDREN) // PARENTS == 1
        push = jnp.where(second[:, None], 0.0, push)  # the policy alone is always tried

        def step(carry: tuple[EpisodeState, jax.Array, jax.Array], number: jax.Array):
            state, total, ended = carry
            share = jnp.minimum((number + 1.0) / WINDOW, 1.0)
            fades = 1.0 - jnp.maximum(number + 1.0 - WINDOW, 0.0) / (AHEAD - WINDOW)
            added = fades * ((1.0 - share) * before + share * push)
            state, cost, ends, seen = self._advance(world, state, added)
            return (state, total + cost, ended | ends), seen

        begin = (
            take(population.state, parent),
            jnp.zeros(CHILDREN),
            jnp.zeros(CHILDREN, bool),
        )
        kept, steps = jax.lax.scan(step, begin, jnp.arange(WINDOW))
        (_, total, ended), _ = jax.lax.scan(step, kept, jnp.arange(WINDOW, AHEAD))
        score = total / AHEAD + jnp.where(ended, _ENDED, 0.0)
        chosen = sampler.fittest(score)
        after = Population(take(kept[0], chosen), push[chosen], score[chosen])
        return after, parent[chosen], jax.tree.map(lambda x: x[:, chosen], steps)

    def _advance(self, world: World, state: EpisodeState, added: jax.Array):
        """One step, its cost [B], whether an episode ends early [B], and what is kept of it."""
        env, action = self.env, self.act(state.observation) + added
        state, output = env.advance(world, state.replace(key=jnp.zeros(2, jnp.uint32)), action)
        kinematics = state.physics.kinematics
        value = env.observer.posture(kinematics, world.terrain).features
        target = env.targets(state)[:, 0]
        gap = jnp.sum(jnp.abs(value - target) / FEATURE_SCALE, axis=-1)
        asked = env.decoder(world).asked(state.action, state.start_offset)
        unnatural = (jnp.sum(jnp.abs(asked), axis=-1) / env.config.offset_limit_rad) ** 2
        cost = jnp.where(kinematics.finite, gap + unnatural, _FAILED)
        return state.replace(key=None), cost, output.terminated, Steps(value, target, state.time)


class Search:
    """The compiled search of a task, one episode after the other."""

    def __init__(self, task: BuiltTask, act: Callable[[jax.Array], jax.Array]) -> None:
        self._env, self._world = task.environment, task.world
        follower, options = Follower(self._env, act), self._env.engine.compiler_options
        self._start = jax.jit(follower.start)
        self._window = jax.jit(follower.window, compiler_options=options)

    def follow(self, getup: int, row: int, curve: Curve, key: jax.Array) -> Steps:
        """The steps [T, ...] of the best way found along one curve: points [9, 3], duration []."""
        whole = (jnp.full(PARENTS, getup), jnp.full(PARENTS, row))
        same = jax.tree.map(lambda x: jnp.repeat(jnp.asarray(x)[None], PARENTS, axis=0), curve)
        population = self._start(self._world, *whole, same)
        seconds = float(curve.duration) + _AFTER_S
        history = []
        for part in range(math.ceil(seconds / self._env.engine.control_dt / WINDOW)):
            key_window = jax.random.fold_in(key, part)
            population, parent, steps = self._window(self._world, population, key_window)
            history.append((np.asarray(parent), jax.tree.map(np.asarray, steps)))
        return _way_to(int(np.argmin(np.asarray(population.score))), history)


def bound(
    task: BuiltTask, learner: Learner, policy: Any, plan: Plan, progress: Progress
) -> ControlGain:
    """The control gain of the search for the episodes of a plan of `edit_plan`, one by one.

    Only of edits for which it got up along both the variant and the curve; `success` is the share
    of the variants for which it did. Where it got lost, it says nothing about what is possible.
    """
    search = Search(task, lambda observation: learner.act(policy, observation))
    curves, found = plan_curves(task, plan), []
    for number in range(len(plan.getup)):
        curve = take(curves, jnp.asarray(number))
        key = jax.random.PRNGKey(number)
        found.append(search.follow(plan.getup[number], plan.row[number], curve, key))
        progress(number + 1)
    most = max(len(steps.time) for steps in found)

    def joined(values: Sequence[np.ndarray]) -> np.ndarray:
        """[T, N, ...]; the shorter ones are filled up at the end."""
        padded = [np.pad(x, [(0, most - len(x))] + [(0, 0)] * (x.ndim - 1)) for x in values]
        return np.stack(padded, axis=1)

    stands = np.array([gets_up(steps) for steps in found])
    rises = [s.time < t for s, t in zip(found, np.asarray(curves.duration), strict=True)]
    responses = of_values(
        joined([steps.features for steps in found]),
        joined([steps.target for steps in found]),
        joined(rises) & stands,
        curves_of(plan),
    )
    variants = stands.reshape(responses.curves, -1)[:, 1:]
    return gain_of(responses, task, float(variants.mean()))


def gets_up(steps: Steps) -> bool:
    """Whether the last of the steps [T, ...] stands as high as success asks."""
    return bool(steps.features[-1, 0] >= STAND_LOWEST * steps.target[-1, 0])


def _way_to(number: int, history: list[tuple[np.ndarray, Steps]]) -> Steps:
    """The steps [T, ...] that led to one of the last population."""
    parts = []
    for parent, steps in reversed(history):
        parts.append(jax.tree.map(lambda x, number=number: x[:, number], steps))
        number = int(parent[number])
    return jax.tree.map(lambda *x: np.concatenate(x), *reversed(parts))
