"""Runs episodes without noise in the actions, and records what the scores need of them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from getup_jax.envs.getup import terminations
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.envs.getup.drawn_curves import Curve, style_curve
from getup_jax.envs.getup.episode import LYING, STANDING, EpisodeState
from getup_jax.envs.getup.task import GetUpTask
from getup_jax.evaluation import motion_quality
from getup_jax.evaluation.motion_quality import FootPoints, self_penetration
from getup_jax.evaluation.outside import Acting, OutsidePolicy, seen, to_action
from getup_jax.evaluation.scenario import PUSH_AFTER_S, Plan
from getup_jax.motion.clips import GetUp
from getup_jax.physics.push import push
from getup_jax.rl.learner import Learner

BATCH = 256  # episodes simulated at once, at most
CHUNK = 10  # control steps between two looks at the state: for pushes, progress and the end
PUSHED_LINK = "spine_upper"
Progress = Callable[[float], None]  # of the number of episodes done so far


@struct.dataclass
class Trace:
    """What happened in N episodes, step by step; leaves [T, N, ...], float32 or bool.

    Steps after an episode's end (`running` is False) mean nothing.
    """

    features: Any  # [T, N, 3] height (m), side and front angle (rad)
    target: Any  # [T, N, 3] the curves at the same time
    time: Any  # [T, N] s since the curve's start
    duration: Any  # [T, N] s, T of the curve
    qpos: Any  # [T, N, 7 + J]
    task_reward: Any  # [T, N]
    torque: Any  # [T, N] mean |torque| of a hinge (Nm)
    power: Any  # [T, N] W
    jerk: Any  # [T, N] rad/s^3; NaN in the first two steps
    saturation: Any  # [T, N] share of the hinges at their torque limit
    offset: Any  # [T, N] |dq|_1 of the filtered offsets (rad)
    slip: Any  # [T, N] m/s of the feet on the ground; NaN: no foot is
    running: Any  # [T, N] the step belongs to the episode
    success: Any  # [T, N] the episode ended here, standing
    head_gap: Any  # [T, N] m from the head's lowest point to the ground
    pushed: Any = None  # [T, N] an impulse came before this step
    penetration: Any = None  # [T, N] deepest overlap of two links (m); NaN where not looked at


@dataclasses.dataclass(frozen=True, eq=False)
class Episodes:
    """N episodes that were run, and what they were."""

    task: BuiltTask
    plan: Plan
    trace: Trace

    @property
    def getup(self) -> np.ndarray:
        """Style [N] of every episode."""
        return self.plan.getup

    @property
    def styles(self) -> tuple[GetUp, ...]:
        """All styles, in the order that `getup` counts them."""
        return self.task.getups


@struct.dataclass
class Carry:
    """B episodes between two steps."""

    state: EpisodeState
    running: jax.Array  # [B] bool
    rates: jax.Array  # [2, B, J] hinge rates of the last two steps (rad/s); NaN at the start


@dataclasses.dataclass(frozen=True, eq=False)
class Roller:
    """The jitted part: `start`, and CHUNK steps at a time with `advance`."""

    env: GetUpTask
    learner: Learner | None  # None: a policy from outside acts, see `run_episodes`
    kind: int
    feet: FootPoints

    def start(
        self,
        world: Any,
        getup: jax.Array,
        row: jax.Array,
        curve: Curve,
        region: jax.Array | None,
    ) -> Carry:
        """Fresh episodes [B]; see `Plan`."""
        env, size = self.env, len(getup)
        kind = jnp.full(size, self.kind, jnp.int32)
        state = env.start(world, getup, kind, row, curve, region)
        hinges = env.character.num_joints
        return Carry(state, jnp.ones(size, bool), jnp.full((2, size, hinges), jnp.nan, jnp.float32))

    def advance(self, world: Any, policy: Any, carry: Carry) -> tuple[Carry, Trace]:
        """CHUNK control steps; the trace's leaves are [CHUNK, B, ...]."""
        learner = self.learner
        assert learner is not None  # `_advance` has seen to it

        def step(carry: Carry, _: None) -> tuple[Carry, Trace]:
            return self.step(world, carry, learner.act(policy, carry.state.observation))

        return jax.lax.scan(step, carry, None, length=CHUNK)

    def step(self, world: Any, carry: Carry, action: jax.Array) -> tuple[Carry, Trace]:
        """One control step with actions [B, A]; the trace's leaves are [B, ...]."""
        state, output = self.env.advance(world, carry.state, action)
        rates = jnp.concatenate([carry.rates, state.physics.kinematics.qvel[None, :, 6:]])
        trace = self._trace(world, carry.running, state, output, rates)
        running = carry.running & ~output.done
        return Carry(state, running, rates[1:]), trace

    def _trace(
        self, world: Any, running: jax.Array, state: EpisodeState, output: Any, rates: jax.Array
    ) -> Trace:
        env, kinematics = self.env, state.physics.kinematics
        verdict = "stand_success" if self.kind == STANDING else "success"
        offset = env.decoder(world).offset(state.action)
        limit = jnp.asarray(env.character.torque_limit, jnp.float32)
        return Trace(
            features=env.observer.posture(kinematics, world.terrain).features,
            target=env.targets(state)[:, 0],
            time=state.time,
            duration=state.duration,
            qpos=kinematics.qpos,
            task_reward=output.terms["task"],
            torque=jnp.abs(kinematics.torque).mean(axis=-1),
            power=motion_quality.power(kinematics.torque, rates[-1]),
            jerk=motion_quality.jerk(rates, env.engine.control_dt),
            saturation=motion_quality.saturation(kinematics.torque, limit),
            offset=jnp.abs(offset).sum(axis=-1),
            slip=self.feet.slip(kinematics, world.terrain),
            running=running,
            success=running & (output.episode[verdict] == 1.0),
            head_gap=terminations.head_gap(env.character, world.terrain, kinematics),
        )


def run_episodes(
    task: BuiltTask, learner: Learner | None, policy: Any, plan: Plan, progress: Progress
) -> Episodes:
    """The plan's N episodes in batches of one size; the trace's leaves are NumPy arrays.

    policy: a PolicyState of the learner; or, with no learner, an OutsidePolicy.
    """
    env = task.environment
    roller = Roller(env, learner, plan.kind, FootPoints.of(env.character))
    options = env.engine.compiler_options
    start = jax.jit(roller.start, compiler_options=options)
    advance = _advance(roller, options)
    episodes, parts, curves = len(plan.getup), [], plan_curves(task, plan)
    size = math.ceil(episodes / math.ceil(episodes / BATCH))
    most = episode_steps(task, plan)
    for first in range(0, episodes, size):
        # the last batch is filled up, so that one program serves all of them
        index = np.minimum(np.arange(first, first + size), episodes - 1)
        keep = min(size, episodes - first)
        region = None if plan.region is None else plan.region[index]
        curve = jax.tree.map(lambda x, index=index: x[index], curves)
        carry = start(task.world, plan.getup[index], plan.row[index], curve, region)
        chunks = []
        acting = policy.begun() if isinstance(policy, OutsidePolicy) else policy
        for chunk in _chunks(task, advance, acting, carry, plan.impulse[index]):
            chunks.append(jax.tree.map(lambda x, keep=keep: x[:, :keep], chunk))
            progress(first + keep * min(1.0, CHUNK * len(chunks) / most))
        parts.append(jax.tree.map(lambda *x: np.concatenate(x), *chunks))
        progress(first + keep)
    return Episodes(task, plan, _join(parts))


def _advance(roller: Roller, options: Any) -> Callable[[Any, Any, Carry], tuple[Carry, Trace]]:
    """CHUNK control steps: one program, or, where a policy from outside acts, step by step."""
    if roller.learner is not None:
        return jax.jit(roller.advance, compiler_options=options)
    step = jax.jit(roller.step, compiler_options=options)
    look = jax.jit(lambda world, state: seen(roller.env, world, state))

    def advance(world: Any, policy: Acting, carry: Carry) -> tuple[Carry, Trace]:
        parts, state = [], policy.state or jax.device_get(look(world, carry.state))
        for _ in range(CHUNK):
            carry, trace = step(world, carry, to_action(roller.env, policy.act(state)))
            state = jax.device_get(look(world, carry.state))
            parts.append(jax.device_get(trace))
        policy.state = state
        return carry, jax.tree.map(lambda *x: np.stack(x), *parts)

    return advance


def plan_curves(task: BuiltTask, plan: Plan) -> Curve:
    """What the plan's episodes [N] follow."""
    own = style_curve(task.world, jnp.asarray(plan.getup))
    points = own.points if plan.points is None else jnp.asarray(plan.points)
    return Curve(points=points, duration=own.duration * plan.duration_scale)


def episode_steps(task: BuiltTask, plan: Plan) -> int:
    """Control steps of the longest of the plan's episodes."""
    rise = float(plan_curves(task, plan).duration.max()) if plan.kind == LYING else 0.0
    total = rise + task.environment.config.stand_time_s
    return math.ceil(total / task.environment.engine.control_dt)


def _chunks(
    task: BuiltTask, advance: Any, policy: Any, carry: Carry, impulse: np.ndarray
) -> Iterator[Trace]:
    """The traces of one batch as NumPy arrays, CHUNK steps each, until every episode has ended."""
    env = task.environment
    link = env.character.link(PUSHED_LINK)
    waiting = np.linalg.norm(impulse, axis=-1) > 0
    while np.asarray(carry.running).any():
        state = carry.state
        late = np.asarray(state.time - state.duration) > PUSH_AFTER_S - 0.5 * env.engine.control_dt
        hit = waiting & late & np.asarray(carry.running)
        if hit.any():
            due = np.where(hit[:, None], impulse, 0.0)
            physics = push(env.engine, env.character, state.physics, due, link)
            carry = carry.replace(state=state.replace(physics=physics))
            waiting &= ~hit
        carry, trace = advance(task.world, policy, carry)
        trace = jax.tree.map(np.asarray, trace)
        pushed = np.zeros_like(trace.running)
        pushed[0] = hit
        yield trace.replace(pushed=pushed, penetration=_penetration(env.character.model, trace))


def _penetration(model: Any, trace: Trace) -> np.ndarray:
    """[CHUNK, B] of the chunk's last step, NaN elsewhere."""
    depth = np.full(trace.running.shape, np.nan, np.float32)
    alive = np.flatnonzero(trace.running[-1])
    depth[-1, alive] = self_penetration(model, trace.qpos[-1, alive])
    return depth


def _join(parts: list[Trace]) -> Trace:
    """Batches side by side; the shorter ones go on with steps that do not run."""
    steps = max(len(part.running) for part in parts)

    def pad(x: np.ndarray) -> np.ndarray:
        return np.pad(x, [(0, steps - len(x))] + [(0, 0)] * (x.ndim - 1))

    return jax.tree.map(lambda *x: np.concatenate([pad(part) for part in x], axis=1), *parts)
