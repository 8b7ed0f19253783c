"""A whole search of one style: window after window, and the states worth keeping."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.envs.getup.build import BuiltTask
from getup_jax.envs.getup.references import Reference as Motion
from getup_jax.envs.getup.references import between_frames, make_references
from getup_jax.envs.getup.resets.archived_states import FoundPath
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.events import link_positions
from getup_jax.trajectory_search.sampling import Population, Reference, Sampler, Settings, Window

# From the one that most often got far to the one that helps out.
ROUNDS = (
    Settings(steps=2, spread_rad=0.3, pose=1.0, memory=0.9),
    Settings(steps=6, spread_rad=0.4, pose=0.3, memory=0.7),
    Settings(steps=4, spread_rad=0.2, pose=1.0, memory=0.9),
)
POPULATION = 64  # episodes that go on from one window to the next
LEAD_S = 0.1  # servo targets come this much before the pose that they ask for
SURVIVE_S = 0.4  # a state is kept if descendants of it are alive this much later ...
STANDS, FOLLOWS, LOST = 0.6, 0.5, 0.12  # task rewards of half the population
MARGIN_S = 0.3  # states this close to where a search got lost are not kept
_LEAST_TRUST = 0.2  # of a motion that does not look like the curve


@dataclasses.dataclass(frozen=True, eq=False)
class _Moment:
    """The population before a window, and what the window made of it."""

    qpos: np.ndarray  # [K, 7 + J]
    qvel: np.ndarray  # [K, 6 + J]
    action: np.ndarray  # [K, A]
    window: Window


class Finder:
    """Searches ways up for the styles of a task."""

    def __init__(self, task: BuiltTask, children: int = 2048) -> None:
        self.task = task
        self._sampler = Sampler(task.environment, POPULATION, children)
        self._start = jax.jit(self._sampler.start)
        self._window = jax.jit(self._sampler.window)
        self._motions = make_references(task.getups, task.environment.character)

    def find(self, style: int, settings: Settings, seed: int) -> FoundPath | None:
        """The states on the way that one search finds; None for a style without a motion."""
        motion = self._motions[style]
        if motion is None:
            return None
        reference = self._reference(style, motion, settings.steps)
        population = self._start(self.task.world, style)
        key = jax.random.fold_in(jax.random.PRNGKey(seed), style)
        moments: list[_Moment] = []
        windows = len(reference.trust) // settings.steps
        for number in range(windows):
            first = number * settings.steps
            part = Reference(
                action=reference.action[first : first + settings.steps + 1],
                links=reference.links[first : first + settings.steps],
                trust=reference.trust[first : first + settings.steps],
            )
            before = population
            population, window = self._window(
                self.task.world, before, part, settings, jax.random.fold_in(key, number)
            )
            moments.append(_moment(before, window))
            if self._is_lost(moments, settings):
                break
        finished = len(moments) == windows and _median(moments[-1]) > STANDS
        return self._keep(style, moments, settings, finished, seed)

    def _reference(self, style: int, motion: Motion, steps: int) -> Reference:
        env, world = self.task.environment, self.task.world
        dt, duration = env.engine.control_dt, self.task.getups[style].duration
        total = duration + env.config.stand_time_s
        count = -(-round(total / dt) // steps) * steps
        time = np.arange(count + 1) * dt
        last = len(motion.clip.qpos) - 1
        wanted = np.minimum((time + LEAD_S) * motion.clip.fps, last)
        angles = jnp.asarray(between_frames(motion.clip, wanted)[:, 7:], jnp.float32)
        condition = curves.evaluate(
            world.points[style], jnp.asarray(np.minimum(time / duration, 1.0), jnp.float32)
        )
        action = env.decoder(world).nearest(angles, condition)
        frame = np.minimum(time[1:] * motion.clip.fps, last).round().astype(int)
        links = link_positions(motion.clip, env.character)[frame]
        trust = np.clip(2.0 - motion.gap[frame], _LEAST_TRUST, 1.0)
        return Reference(action, jnp.asarray(links, jnp.float32), jnp.asarray(trust, jnp.float32))

    def _is_lost(self, moments: Sequence[_Moment], settings: Settings) -> bool:
        """Whether nothing has followed the curve for so long that nothing will."""
        patience = max(3, 12 // settings.steps)
        late = len(moments) * settings.steps > 20
        return late and max(_median(moment) for moment in moments[-patience:]) < LOST

    def _keep(
        self,
        style: int,
        moments: Sequence[_Moment],
        settings: Settings,
        finished: bool,
        seed: int,
    ) -> FoundPath:
        """The states that led on, as far as the population followed the curve."""
        dt = self.task.environment.engine.control_dt
        reward = np.array([_median(moment) for moment in moments])
        good = np.flatnonzero(reward > STANDS)
        end = (good[-1] if len(good) else 0) * settings.steps * dt - (0 if finished else MARGIN_S)
        end = min(end, self.task.getups[style].duration)
        lag = max(1, round(SURVIVE_S / (settings.steps * dt)))
        env = self.task.environment
        hinges, actions = env.character.num_joints, env.action_size
        none = np.zeros(0)
        parts = [(*(np.zeros((0, n)) for n in (7 + hinges, 6 + hinges, actions)), none, none)]
        for number, moment in enumerate(moments):
            time = number * settings.steps * dt
            if time >= end or reward[number] <= FOLLOWS:
                continue
            chosen = _ancestors(
                [np.asarray(m.window.parent) for m in moments[number : number + lag]]
            )
            states = (x[chosen] for x in (moment.qpos, moment.qvel, moment.action))
            same = np.ones(len(chosen))
            parts.append((*states, time * same, reward[number] * same))
        values = (np.concatenate(part) for part in zip(*parts, strict=True))
        return FoundPath(*values, finished=finished, seed=seed)


def _moment(before: Population, window: Window) -> _Moment:
    kinematics = before.state.physics.kinematics
    values = (kinematics.qpos, kinematics.qvel, before.state.action)
    return _Moment(*(np.asarray(x) for x in values), window=jax.tree.map(np.asarray, window))


def _median(moment: _Moment) -> float:
    return float(np.median(moment.window.task_reward))


def _ancestors(parents: Sequence[np.ndarray]) -> np.ndarray:
    """Those of the first population whose descendants went through all windows."""
    alive = np.arange(len(parents[0]))
    for parent in reversed(parents):
        alive = parent[alive]
    return np.unique(alive)
