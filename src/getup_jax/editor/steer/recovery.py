"""After a fall: a get-up policy acts until the character stands, or it is put back on its feet."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.core.types import Engine, PhysicsState
from getup_jax.editor.simulate import Log, editor_config
from getup_jax.envs.composite.link_frames import link_state
from getup_jax.envs.composite.task import CompositeState
from getup_jax.envs.getup.build import BuiltTask, build_task
from getup_jax.envs.getup.episode import LYING, STAND_LOWEST, EpisodeState
from getup_jax.envs.getup.resets.pool import Pool
from getup_jax.evaluation.getup import restore_policy
from getup_jax.evaluation.steering import Player
from getup_jax.physics.body_digest import body_digest, warn_if_other
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.pose_prior.data import pose_conditions
from getup_jax.runtime.checkpoint import LoadedPolicy

_STANDS_S = 0.5  # at the height of a standing body for so long: it stands
_PATIENCE_S = 3.0  # past the end of its curve; then it has not stood up


class Rising(Protocol):
    """What gets a lying character up."""

    def begin(self, qpos: np.ndarray, qvel: np.ndarray) -> Any:
        """Its own state, from how the character lies now: [1, 7 + J] and [1, 6 + J]."""
        ...

    def step(self, state: Any) -> Any:
        """One control step."""
        ...

    def pose(self, state: Any) -> tuple[np.ndarray, np.ndarray]:
        """The character's qpos [1, 7 + J] and qvel [1, 6 + J]."""
        ...

    def stands(self, state: Any) -> bool | None:
        """Whether it stands; None: not yet, but it may; False: it did not manage to."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class GetUp:
    """A trained get-up policy, which follows the curve of the style that starts most alike.

    Its character may have other names and links, but not other hinges, than the one that fell.
    """

    task: BuiltTask
    name: str
    start: Any  # (world, style [1]) -> EpisodeState
    advance: Any  # EpisodeState -> EpisodeState
    ratio: Any  # EpisodeState -> height of the neck by that at the curve's end

    @classmethod
    def build(cls, loaded: LoadedPolicy, log: Log) -> GetUp:
        """The policy in its task, compiled when it first acts."""
        config = editor_config(loaded.config)
        task = build_task(config, log, pose_prior.from_checkpoint(loaded.prior))
        body = body_digest(task.environment.character.model)
        warn_if_other(loaded.path, loaded.metadata, body, log)
        return cls.of(task, loaded)

    @classmethod
    def of(cls, task: BuiltTask, loaded: LoadedPolicy) -> GetUp:
        """The policy in a finished task."""
        learner, policy = restore_policy(loaded, task)
        env, world, first = task.environment, task.world, jnp.zeros(1, jnp.int32)

        def start(world: Any, style: jax.Array) -> EpisodeState:
            return env.start(world, style, jnp.full_like(first, LYING), first)

        def advance(state: EpisodeState) -> EpisodeState:
            return env.advance(world, state, learner.act(policy, state.observation))[0]

        def ratio(state: EpisodeState) -> jax.Array:
            seen = env.observer.posture(state.physics.kinematics, world.terrain)
            return seen.features[0, 0] / state.points[0, -1, 0]

        options = env.engine.compiler_options
        compiled = [jax.jit(f, compiler_options=options) for f in (start, advance, ratio)]
        return cls(task, loaded.path.name, *compiled)

    def begin(self, qpos: np.ndarray, qvel: np.ndarray) -> tuple[EpisodeState, int]:
        """An episode from how the body lies, and for how many steps it has stood."""
        physics = self.task.environment.engine.place(qpos, qvel)
        table = jnp.zeros((3, 1, len(self.task.getups), 1), jnp.int32)
        world = self.task.world.replace(pool=Pool(physics, jnp.zeros(1), table))
        return self.start(world, np.array([self._style(qpos)], np.int32)), 0

    def _style(self, qpos: np.ndarray) -> int:
        """The style whose first torso angles are nearest to those of a pose [1, 7 + J]."""
        angles = pose_conditions(qpos, self.task.environment.character)[0, 1:]
        first = np.stack([getup.points[0, 1:] for getup in self.task.getups])
        return int(np.abs(first - angles).max(axis=1).argmin())

    def step(self, state: tuple[EpisodeState, int]) -> tuple[EpisodeState, int]:
        """One control step."""
        episode = self.advance(state[0])
        upright = float(self.ratio(episode)) >= STAND_LOWEST  # NaN is not
        return episode, state[1] + 1 if upright else 0

    def pose(self, state: tuple[EpisodeState, int]) -> tuple[np.ndarray, np.ndarray]:
        """The character's qpos [1, 7 + J] and qvel [1, 6 + J]."""
        seen = state[0].physics.kinematics
        return np.asarray(seen.qpos), np.asarray(seen.qvel)

    def stands(self, state: tuple[EpisodeState, int]) -> bool | None:
        """Whether it stands; None: not yet, but it may; False: it did not manage to."""
        episode, steps = state
        if steps * self.task.environment.engine.control_dt >= _STANDS_S:
            return True
        late = float(episode.time[0] - episode.duration[0]) > _PATIENCE_S
        return False if late or not bool(episode.physics.kinematics.finite[0]) else None


def fresh(player: Player, key: jax.Array, place: np.ndarray | None = None, yaw: float = 0.0) -> Any:
    """A fresh episode of the policy; with a place [2] (m) it begins there, and faces the yaw (rad).

    A place or yaw that is not finite is that of the start state itself.
    """
    state = player.begin(player.world, key)
    if place is None or not np.isfinite([*place, yaw]).all():
        return state
    task = moved(player.env.task_state(state), player.task.engine, place, yaw)
    return player.adopt(player.world, task, player.goal_states(state), key)


def moved(state: CompositeState, engine: Engine, place: np.ndarray, yaw: float) -> CompositeState:
    """One episode [1] with its root at a place [2] (m), facing the yaw (rad)."""
    seen = state.physics.kinematics
    root, (w, z) = np.asarray(seen.qpos[0, :2]), np.asarray(seen.qpos[0, 3:7])[[0, 3]]
    turn = Rotation.from_euler("z", yaw - 2.0 * np.arctan2(z, w))
    qpos, qvel = (np.asarray(x, np.float64).copy() for x in (seen.qpos, seen.qvel))
    qpos[:, :2] = place
    qpos[:, 3:7] = _turned_quaternions(turn, qpos[:, 3:7])
    qvel[:, :3] = turn.apply(qvel[:, :3])  # the angular velocity is in the root's own frame
    frames = np.asarray(state.history).copy()
    position, linear, angular = (frames[..., i : i + 3] for i in (0, 7, 10))
    position -= [*root, 0.0]
    for vectors in (position, linear, angular):
        vectors[...] = vectors @ turn.as_matrix().T
    position += [*place, 0.0]
    frames[..., 3:7] = _turned_quaternions(turn, frames[..., 3:7])
    return state.replace(physics=engine.place(qpos, qvel), history=jnp.asarray(frames))


def _turned_quaternions(turn: Rotation, quaternions: np.ndarray) -> np.ndarray:
    """Rotations [..., 4] (wxyz), then the turn."""
    found = turn * Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=True)
    return found.as_quat(scalar_first=True).reshape(quaternions.shape)


@jax.jit
def followed(history: jax.Array, physics: PhysicsState) -> jax.Array:
    """The history after a control step that somebody else took."""
    return jnp.concatenate([history[:, 1:], link_state(physics.kinematics)[:, None]], axis=1)


@functools.cache  # one program for all characters
def limp(engine: Engine) -> Callable[[PhysicsState], PhysicsState]:
    """A control step in which the servos hold nothing, they only damp."""

    def step(physics: PhysicsState) -> PhysicsState:
        return engine.step(physics, physics.kinematics.qpos[:, 7:])

    return jax.jit(step, compiler_options=engine.compiler_options)
