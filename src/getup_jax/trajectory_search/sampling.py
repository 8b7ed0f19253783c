"""One window of the search: children of the population try changes, the best go on."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.core.types import take
from getup_jax.envs.getup.episode import LYING, EpisodeState
from getup_jax.envs.getup.task import GetUpTask, World
from getup_jax.motion.getup.curve_alignment import FEATURE_SCALE

MOST_CHILDREN = 4  # of one parent that may go on
_PERSISTENCE = 0.8  # share of a parent's change that its children keep
_CHANGED = 0.5  # share of the action's entries that a child changes
_POSE_SCALE_M = 0.08  # mean distance of the links that counts as FEATURE_SCALE does
_LATENT_SPREAD = 2.5  # of the latent's entries, for a spread of 1 rad in the hinges
_TAMEST, _WILDEST = -2.0, 0.5  # logarithms of the smallest and largest share of the spread
_FAILED = 1e3  # cost of a state that is not finite


class Settings(NamedTuple):
    """How the search samples."""

    steps: int  # control steps of a window
    spread_rad: float  # largest standard deviation of a hinge's change
    pose: float  # weight of the reference's pose beside the curves
    memory: float  # share of a parent's score in that of its children


@struct.dataclass
class Reference:
    """What the motion asks for over W steps."""

    action: jax.Array  # [W + 1, A], of the state before and of every step
    links: jax.Array  # [W, L, 3] link positions above flat ground (m)
    trust: jax.Array  # [W] how much the motion looks like the curve, 0 to 1


@struct.dataclass
class Population:
    """K episodes of one style that go on."""

    state: EpisodeState  # rows; without key
    score: jax.Array  # [K] the lower, the better


@struct.dataclass
class Window:
    """What became of the K that went on."""

    parent: jax.Array  # [K] int32 their parents' numbers
    task_reward: jax.Array  # [K] at the window's end


@dataclasses.dataclass(frozen=True, eq=False)
class Sampler:
    """The jitted part of the search."""

    env: GetUpTask
    size: int  # K
    children: int  # B, all of them; a multiple of K

    def start(self, world: World, style: jax.Array) -> Population:
        """K lying starts of a style."""
        same = jnp.full(self.size, style, jnp.int32)
        kind = jnp.full(self.size, LYING, jnp.int32)
        state = self.env.start(world, same, kind, jnp.arange(self.size))
        return Population(state.replace(key=None), jnp.zeros(self.size))

    def window(
        self,
        world: World,
        population: Population,
        reference: Reference,
        settings: Settings,
        key: jax.Array,
    ) -> tuple[Population, Window]:
        """W steps of B children; settings may be traced, but for its steps."""
        parent = jnp.arange(self.children) % self.size
        state = take(population.state, parent)
        before = state.action - reference.action[0]
        change = _PERSISTENCE * before + self.noise(settings.spread_rad, key)

        def step(
            carry: tuple[EpisodeState, jax.Array], x: tuple[Reference, jax.Array]
        ) -> tuple[tuple[EpisodeState, jax.Array], tuple[jax.Array, jax.Array]]:
            (state, total), (now, share) = carry, x
            wanted = now.action + (1.0 - share) * before + share * change
            state, reward = self._advance(world, state, wanted)
            cost = self._cost(world, state, now, settings.pose)
            return (state, total + cost), (cost, reward)

        count = reference.trust.shape[0]
        steps = reference.replace(action=reference.action[1:])
        shares = (jnp.arange(count) + 1.0) / count
        begin = (state, jnp.zeros(self.children))
        (state, total), (cost, reward) = jax.lax.scan(step, begin, (steps, shares))
        score = settings.memory * population.score[parent] + total / count + cost[-1]
        chosen = self.fittest(score)
        return (
            Population(take(state, chosen), score[chosen]),
            Window(parent=parent[chosen], task_reward=reward[-1, chosen]),
        )

    def noise(
        self, spread: jax.Array | float, key: jax.Array, tamest: float = _TAMEST
    ) -> jax.Array:
        """Changes [B, A] of the filtered action, from none (one child of each parent) to wild.

        tamest: logarithm of the smallest size of the others, as a share of the spread.
        """
        key_value, key_size, key_which = jax.random.split(key, 3)
        shape = (self.children, self.env.action_size)
        latent = self.env.latent_size
        hinge = jnp.full(shape[1] - latent, 1.0 / self.env.config.offset_scale)
        scale = spread * jnp.concatenate([jnp.full(latent, _LATENT_SPREAD), hinge])
        size = jnp.exp(jax.random.uniform(key_size, (shape[0], 1), minval=tamest, maxval=_WILDEST))
        which = jax.random.uniform(key_which, shape) < _CHANGED
        noise = scale * size * which * jax.random.normal(key_value, shape)
        return jnp.where(jnp.arange(self.children)[:, None] < self.size, 0.0, noise)

    def _advance(
        self, world: World, state: EpisodeState, wanted: jax.Array
    ) -> tuple[EpisodeState, jax.Array]:
        """One step towards the filtered action [B, A], and its task reward [B]."""
        share = self.env.config.filter
        action = (wanted - (1.0 - share) * state.action) / share
        key = jnp.zeros(2, jnp.uint32)
        state, output = self.env.advance(world, state.replace(key=key), action)
        return state.replace(key=None), output.terms["task"]

    def _cost(
        self, world: World, state: EpisodeState, now: Reference, pose: jax.Array | float
    ) -> jax.Array:
        """[B]; 1 is a gap of FEATURE_SCALE between the body and the curves."""
        kinematics = state.physics.kinematics
        value = self.env.observer.posture(kinematics, world.terrain).features
        gap = jnp.abs(value - self.env.targets(state)[:, 0]) / FEATURE_SCALE
        links = kinematics.link_position
        apart = distance(links, jnp.broadcast_to(now.links, links.shape)) / _POSE_SCALE_M
        return jnp.where(kinematics.finite, gap.sum(axis=-1) + pose * now.trust * apart, _FAILED)

    def fittest(self, score: jax.Array) -> jax.Array:
        """Numbers [K] of the children that go on."""
        siblings = score.reshape(-1, self.size)
        rank = jnp.argsort(jnp.argsort(siblings, axis=0), axis=0).reshape(-1)
        return jnp.argsort(jnp.where(rank < MOST_CHILDREN, score, jnp.inf))[: self.size]


def distance(links: jax.Array, target: jax.Array) -> jax.Array:
    """Mean distance [...] (m) of two sets of links [..., L, 3], whatever their place and heading.

    The horizontal move and turn are those of least squares.
    """
    links = links.at[..., :2].add(-links[..., :2].mean(axis=-2, keepdims=True))
    target = target.at[..., :2].add(-target[..., :2].mean(axis=-2, keepdims=True))
    x, y = links[..., 0], links[..., 1]
    cross = jnp.sum(x * target[..., 1] - y * target[..., 0], axis=-1, keepdims=True)
    dot = jnp.sum(x * target[..., 0] + y * target[..., 1], axis=-1, keepdims=True)
    turn = jnp.arctan2(cross, dot)
    cos, sin = jnp.cos(turn), jnp.sin(turn)
    turned = jnp.stack([cos * x - sin * y, sin * x + cos * y, links[..., 2]], axis=-1)
    return jnp.mean(jnp.linalg.norm(turned - target, axis=-1), axis=-1)
