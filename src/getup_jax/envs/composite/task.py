"""The composite-motion task [C]: body groups imitate clips, each judged by a discriminator.

The task gives every objective's reward but for the imitation rewards, which only the learner's
discriminators know: it gives them the windows in `StepOutput.extras`.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.config import CompositeConfig
from getup_jax.core import device_axis
from getup_jax.core.masked_update import replace_rows
from getup_jax.core.types import Engine, Kinematics, PhysicsState, StepOutput, take
from getup_jax.envs.composite.goals.combine import Goals
from getup_jax.envs.composite.goals.goal import GoalOutput
from getup_jax.envs.composite.groups import Group
from getup_jax.envs.composite.link_frames import FRAMES, LINK_STATE, link_state, observe
from getup_jax.envs.composite.reference_windows import References
from getup_jax.physics.character import CharacterSpec

_RESET_CHUNK = 32


@struct.dataclass
class Starts:
    """P start states along the clips, with the frames before them."""

    physics: PhysicsState  # [P]
    history: jax.Array  # [P, FRAMES + 1, L, LINK_STATE]


@struct.dataclass
class CompositeWorld:
    """Every array that the task reads and training does not change."""

    starts: Starts
    references: dict[str, References]  # by group
    target_centre: jax.Array  # [J] servo target of action 0 (rad)
    target_scale: jax.Array  # [J] rad for an action of 1
    target_lower: jax.Array  # [J]
    target_upper: jax.Array  # [J]


@struct.dataclass
class CompositeState:
    """B episodes between two steps."""

    physics: PhysicsState
    observation: jax.Array  # [B, O]
    history: jax.Array  # [B, FRAMES + 1, L, LINK_STATE] world frame, the oldest first
    step: jax.Array  # [B] int32, steps done
    goals: Any  # states of the goal tasks, or None
    attempts: jax.Array  # [B, G] attempts at each goal that ended in this episode
    successes: jax.Array  # [B, G] those that succeeded
    key: Any


@dataclasses.dataclass(frozen=True, eq=False)
class CompositeTask:
    """The `Environment` of composite motion."""

    engine: Engine
    character: CharacterSpec
    config: CompositeConfig
    groups: tuple[Group, ...]
    goals: Goals = dataclasses.field(default_factory=lambda: Goals(()))

    @property
    def frames(self) -> tuple[int, int]:
        """Number and size of the frames that an observation starts with."""
        return FRAMES, len(self.character.link_names) * LINK_STATE

    @property
    def observation_size(self) -> int:
        """O: the frames, then the goal states."""
        return FRAMES * self.frames[1] + self.goals.observation_size

    @property
    def action_size(self) -> int:
        """A: one servo target a hinge."""
        return self.character.num_joints

    @property
    def objectives(self) -> tuple[str, ...]:
        """Names of all objectives: imitations, then goals."""
        return (*(group.name for group in self.groups), *self.goals.names)

    @property
    def num_objectives(self) -> int:
        """K critics: one an objective, or one for the sum of all rewards."""
        return len(self.objectives) if self.config.multi_objective else 1

    def init(self, world: CompositeWorld, key: jax.Array, num_envs: int) -> CompositeState:
        """B fresh episodes."""
        key_row, key_start, key_state = jax.random.split(key, 3)
        row = self._draw(world, key_row, num_envs)
        return self.start(world, row, key_start).replace(key=key_state)

    def stagger(self, state: CompositeState, key: jax.Array) -> CompositeState:
        """Episodes [B] as if they had begun at any time before."""
        last = round(self.config.episode_s / self.engine.control_dt)
        return state.replace(step=jax.random.randint(key, state.step.shape, 0, last))

    def start(self, world: CompositeWorld, row: jax.Array, key: jax.Array) -> CompositeState:
        """Episodes from rows [B] of the start states; the key is for their goals."""
        starts = take(world.starts, row)
        none = jnp.zeros((len(row), len(self.goals.names)), jnp.float32)
        goals = self.goals.reset(key, starts.physics.kinematics)
        return CompositeState(
            physics=starts.physics,
            observation=self.observe(starts.history, goals, starts.physics),
            history=starts.history,
            step=jnp.zeros(row.shape, jnp.int32),
            goals=goals,
            attempts=none,
            successes=none,
            key=None,
        )

    def step(
        self, world: CompositeWorld, state: CompositeState, action: jax.Array
    ) -> tuple[CompositeState, StepOutput]:
        """One control step; episodes that end start anew."""
        after, output = self.advance(world, state, action)
        key_next, key_draw, key_start = jax.random.split(after.key, 3)
        key_draw, key_start = device_axis.own_key(key_draw), device_axis.own_key(key_start)
        drawn = self._draw(world, key_draw, action.shape[0])
        done = output.done

        def fresh(index: jax.Array) -> CompositeState:
            # the first index of a chunk is in no other
            return self.start(world, drawn[index], jax.random.fold_in(key_start, index[0]))

        after = replace_rows(after.replace(key=None), done, fresh, _RESET_CHUNK)
        after = after.replace(key=key_next)
        return after, output.replace(observation=after.observation)

    def advance(
        self, world: CompositeWorld, state: CompositeState, action: jax.Array
    ) -> tuple[CompositeState, StepOutput]:
        """One control step without resets; `observation` is the final one."""
        key, key_goals = jax.random.split(state.key)
        key_goals = device_axis.own_key(key_goals)
        target = world.target_centre + world.target_scale * action
        target = jnp.clip(target, world.target_lower, world.target_upper)
        balls = self.goals.command(state.goals, state.physics.kinematics)
        physics = self.engine.step(state.physics, target, balls)
        finite = physics.kinematics.finite & jnp.isfinite(target).all(axis=-1)
        physics = physics.replace(kinematics=physics.kinematics.replace(finite=finite))
        frame = jnp.where(finite[:, None, None], link_state(physics.kinematics), 0.0)
        history = jnp.concatenate([state.history[:, 1:], frame[:, None]], axis=1)
        goals, goal_outputs = self.goals.step(key_goals, state.goals, physics.kinematics)
        observation = self.observe(history, goals, physics)
        state = state.replace(
            physics=physics,
            observation=jnp.where(finite[:, None], observation, 0.0),
            history=history,
            step=state.step + 1,
            goals=goals,
            key=key,
            **_count(state, goal_outputs),
        )
        return state, self._output(state, goal_outputs)

    def _output(self, state: CompositeState, goals: tuple[GoalOutput, ...]) -> StepOutput:
        """What a step returns; the imitation rewards are 0 until a discriminator gives them."""
        kinematics = state.physics.kinematics
        causes = {
            "fall": kinematics.finite & self.has_fallen(kinematics),
            "not_finite": ~kinematics.finite,
        }
        names = self.goals.names
        causes |= {n: goal.terminated for n, goal in zip(names, goals, strict=True)}
        terminated = jnp.any(jnp.stack(list(causes.values())), axis=0)
        none = jnp.zeros(terminated.shape, jnp.float32)
        rewards = [none for _ in self.groups] + [goal.reward for goal in goals]
        reward = jnp.stack(rewards, axis=-1)
        last = round(self.config.episode_s / self.engine.control_dt)
        return StepOutput(
            observation=state.observation,
            final_observation=state.observation,
            reward=jnp.where(terminated[:, None], self.config.end_reward, reward),
            terminated=terminated,
            truncated=~terminated & (state.step >= last),
            terms={},
            ended=causes,
            metrics={},
            episode={"steps": state.step.astype(jnp.float32)} | self.success(state),
            extras=self.windows(state.history),
        )

    def kinematics(self, state: CompositeState) -> Kinematics:
        """What can be seen of the simulations."""
        return state.physics.kinematics

    def adopt(
        self, world: CompositeWorld, state: CompositeState, goals: Any, key: jax.Array
    ) -> CompositeState:
        """An episode of a task of the same character goes on in this one, with these goals."""
        none = jnp.zeros((len(state.step), len(self.goals.names)), jnp.float32)
        observation = self.observe(state.history, goals, state.physics)
        return state.replace(
            goals=goals, observation=observation, attempts=none, successes=none, key=key
        )

    def task_state(self, state: CompositeState) -> CompositeState:
        """The episode as a task without a meta policy has it."""
        return state

    def goal_states(self, state: CompositeState) -> Any:
        """The states of the goal tasks, in their order."""
        return state.goals

    def success(self, state: CompositeState) -> dict[str, jax.Array]:
        """Share [B] of each goal's attempts so far that succeeded; NaN where none ended."""
        share = state.successes / jnp.where(state.attempts > 0, state.attempts, jnp.nan)
        return {f"success_{name}": share[:, i] for i, name in enumerate(self.goals.names)}

    def observe(self, history: jax.Array, goals: Any, physics: PhysicsState) -> jax.Array:
        """The observation [B, O] of histories [B, FRAMES + 1, L, LINK_STATE] and goals."""
        frames = observe(history[:, 1:])
        if not self.goals.names:
            return frames
        return jnp.concatenate([frames, self.goals.observe(goals, physics.kinematics)], axis=-1)

    def windows(self, history: jax.Array) -> dict[str, jax.Array]:
        """What each group's discriminator sees, [B, F, D] by name."""
        position, quaternion = history[..., :3], history[..., 3:7]
        return {
            group.name: group.window(
                position[:, -group.num_frames :], quaternion[:, -group.num_frames :]
            )
            for group in self.groups
        }

    def has_fallen(self, kinematics: Kinematics) -> jax.Array:
        """Whether [B] a link but the feet is near the ground."""
        names = self.character.link_names
        links = jnp.asarray([i for i, name in enumerate(names) if not name.startswith("foot")])
        height = kinematics.link_position[:, links, 2]
        return jnp.min(height, axis=-1) < self.config.fall_height_m

    def _draw(self, world: CompositeWorld, key: jax.Array, num_envs: int) -> jax.Array:
        return jax.random.randint(key, (num_envs,), 0, len(world.starts.history))


def _count(state: CompositeState, outputs: tuple[GoalOutput, ...]) -> dict[str, jax.Array]:
    """The episode's attempts and successes [B, G] after a step; success is NaN where none ended."""
    if not outputs:
        return {"attempts": state.attempts, "successes": state.successes}
    success = jnp.stack([goal.success for goal in outputs], axis=-1)
    ended = ~jnp.isnan(success)
    return {
        "attempts": state.attempts + ended,
        "successes": state.successes + jnp.where(ended, success, 0.0),
    }
