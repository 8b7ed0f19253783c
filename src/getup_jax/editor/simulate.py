"""One edited curve into one motion: the evaluation's own episode, a chunk of steps at a time."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from getup_jax.config import Config
from getup_jax.editor.starts import ANYWHERE, Place, Starts
from getup_jax.envs.getup.build import BuiltTask, build_task
from getup_jax.envs.getup.drawn_curves import Curve
from getup_jax.envs.getup.episode import LYING
from getup_jax.evaluation.getup import evaluation_config, restore_policy
from getup_jax.evaluation.metrics import episode_values
from getup_jax.evaluation.motion_quality import FootPoints
from getup_jax.evaluation.rollout import CHUNK, Roller, Trace
from getup_jax.evaluation.scenario import Scenario
from getup_jax.motion.clips import GetUp
from getup_jax.motion.io.curve_file import CurveFile
from getup_jax.physics.body_digest import body_digest, warn_if_other
from getup_jax.physics.character import CharacterSpec
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.rl.state import PolicyState
from getup_jax.runtime.checkpoint import LoadedPolicy

_POOL = 416  # start states on irregular ground: eight places a region for thirteen starts

Log = Callable[[str], None]


@dataclasses.dataclass(frozen=True, eq=False)
class Frames:
    """F control steps of a motion, and whether they belong to the episode or come after its end."""

    first: int  # number of the first of them
    qpos: np.ndarray  # [F, 7 + J]
    links: np.ndarray  # [F, L, 7] position (m) and quaternion (wxyz) of every link
    features: np.ndarray  # [F, 3] height (m), side and front angle (rad)
    running: np.ndarray  # [F] bool


@dataclasses.dataclass(frozen=True, eq=False)
class Motion:
    """A whole motion: what it was made from, its frames, and its scores as getup-eval has them."""

    curve: CurveFile
    place: Place
    frames: Frames
    target: np.ndarray  # [F, 3]
    task_reward: np.ndarray  # [F]
    time: np.ndarray  # [F] s since the curve's start
    control_dt: float  # s
    scores: dict[str, float]
    start_gap_rad: float
    start_pose: np.ndarray  # [7 + J] at 0 s, before the first control step


@dataclasses.dataclass(frozen=True, eq=False)
class Simulator:
    """A policy and its compiled episode of one character."""

    config: Config
    task: BuiltTask
    policy: PolicyState
    starts: Starts
    start: Any
    advance: Any

    @classmethod
    def build(cls, loaded: LoadedPolicy, log: Log) -> Simulator:
        """Load the motions and make the start states of a checkpoint's own ground."""
        config = editor_config(loaded.config)
        prior = pose_prior.from_checkpoint(loaded.prior)
        task = build_task(config, log, prior, _with_clips)
        body = body_digest(task.environment.character.model)
        warn_if_other(loaded.path, loaded.metadata, body, log)
        return cls.of(config, task, loaded)

    @classmethod
    def of(cls, config: Config, task: BuiltTask, loaded: LoadedPolicy) -> Simulator:
        """The simulator of a finished task."""
        learner, policy = restore_policy(loaded, task)
        env = task.environment
        roller = Roller(env, learner, LYING, FootPoints.of(env.character))
        options = env.engine.compiler_options
        return cls(
            config=config,
            task=task,
            policy=policy,
            starts=Starts(task, dataclasses.replace(config.task, pool_size=1), config.seed),
            start=jax.jit(roller.start, compiler_options=options),
            advance=jax.jit(roller.advance, compiler_options=options),
        )

    @property
    def character(self) -> CharacterSpec:
        """The character on the ground that it trains on."""
        return self.task.environment.character

    @property
    def control_dt(self) -> float:
        """Seconds between two frames."""
        return self.task.environment.engine.control_dt

    def steps(self, curve: CurveFile) -> int:
        """Control steps of the whole motion: the rise and the standing after it."""
        seconds = curve.durations[0] + self.config.task.stand_time_s
        return math.ceil(seconds / self.control_dt - 0.5)

    def run(self, curve: CurveFile, place: Place = ANYWHERE) -> Iterator[Frames | Motion]:
        """The frames of the curve's first duration as they come, and then the whole motion.

        The simulation goes on after an early end, since one wants to see what happens; scores
        are of the episode alone. Stop between two chunks by no longer asking.
        """
        getup = curve.getups()[0]
        world = self.task.world.replace(pool=self.starts.pool(curve, place))
        zero = np.zeros(1, np.int32)
        followed = Curve(
            points=jnp.asarray(getup.points[None], jnp.float32),
            duration=jnp.asarray([getup.duration], jnp.float32),
        )
        region = None if self.starts.places == 0 else np.full(1, place.region, np.int32)
        carry = self.start(world, zero, zero, followed, region)
        begin = np.asarray(carry.state.physics.kinematics.qpos[0])
        traces, parts, total = [], [], self.steps(curve)
        data = mujoco.MjData(self.character.model)
        for first in range(0, total, CHUNK):
            carry, trace = self.advance(world, self.policy, carry)
            keep = min(CHUNK, total - first)
            trace = jax.tree.map(lambda x, keep=keep: np.asarray(x)[:keep], trace)
            traces.append(trace)
            parts.append(self._frames(first, trace, data))
            yield parts[-1]
        whole: Trace = jax.tree.map(lambda *x: np.concatenate(x), *traces)
        yield Motion(
            curve=curve,
            place=place,
            frames=_joined(parts),
            target=whole.target[:, 0],
            task_reward=whole.task_reward[:, 0],
            time=whole.time[:, 0],
            control_dt=self.control_dt,
            scores=self._scores(whole),
            start_gap_rad=self.starts.gap(curve),
            start_pose=begin,
        )

    def _frames(self, first: int, trace: Trace, data: mujoco.MjData) -> Frames:
        qpos = trace.qpos[:, 0]
        return Frames(
            first=first,
            qpos=qpos,
            links=link_poses(self.character, qpos, data),
            features=trace.features[:, 0],
            running=trace.running[:, 0],
        )

    def _scores(self, trace: Trace) -> dict[str, float]:
        empty = np.full(trace.running.shape, np.nan, np.float32)
        never = np.zeros_like(trace.running)
        trace = trace.replace(penetration=empty, pushed=never)
        values = episode_values(trace, self.control_dt, self.config.task.stand_time_s)
        return {name: float(value[0]) for name, value in values.items()}


def editor_config(config: Config) -> Config:
    """The config of an evaluation with the defaults of getup-eval, for one episode at a time."""
    config = evaluation_config(config, Scenario(episodes=1))
    # the pose prior comes with the checkpoint: nothing needs many poses
    config = dataclasses.replace(config, motion=dataclasses.replace(config.motion, augment_poses=1))
    if config.terrain is None:
        return config
    return dataclasses.replace(config, task=dataclasses.replace(config.task, pool_size=_POOL))


def _with_clips(getups: tuple[GetUp, ...], _: CharacterSpec) -> tuple[GetUp, ...]:
    """The styles that something can start from."""
    return tuple(getup for getup in getups if getup.clip is not None)


def link_poses(
    character: CharacterSpec, qpos: np.ndarray, data: mujoco.MjData | None = None
) -> np.ndarray:
    """Position (m) and quaternion (wxyz) of every link [F, L, 7] in poses [F, 7 + J].

    data: the character's, to work in; it takes longer to make one than to pose ten frames.
    """
    model = character.model
    work: Any = mujoco.MjData(model) if data is None else data
    poses = np.empty((len(qpos), model.nbody - 1, 7), np.float32)
    for row, pose in zip(qpos, poses, strict=True):
        work.qpos[:] = row
        mujoco.mj_kinematics(model, work)
        pose[:, :3], pose[:, 3:] = work.xpos[1:], work.xquat[1:]
    return poses


def _joined(parts: list[Frames]) -> Frames:
    fields = [f.name for f in dataclasses.fields(Frames) if f.name != "first"]
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in fields}
    return Frames(first=0, **joined)
