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

from getup_jax import rotation
from getup_jax.config import CompositeConfig
from getup_jax.physics.character import CharacterSpec
from getup_jax.rows import replace_rows
from getup_jax.tasks.groups import Group
from getup_jax.tasks.reference_windows import References, nearest
from getup_jax.types import Engine, Kinematics, PhysicsState, StepOutput, take

FRAMES = 4  # that the actor sees; a window has the next one too
LINK_STATE = 13  # position 3, quaternion 4, linear and angular velocity 3 each
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
    key: Any


@dataclasses.dataclass(frozen=True, eq=False)
class CompositeTask:
    """The `Environment` of composite motion."""

    engine: Engine
    character: CharacterSpec
    config: CompositeConfig
    groups: tuple[Group, ...]

    @property
    def frames(self) -> tuple[int, int]:
        """Number and size of the frames that an observation starts with."""
        return FRAMES, len(self.character.link_names) * LINK_STATE

    @property
    def observation_size(self) -> int:
        """O."""
        return FRAMES * self.frames[1]

    @property
    def action_size(self) -> int:
        """A: one servo target a hinge."""
        return self.character.num_joints

    @property
    def objectives(self) -> tuple[str, ...]:
        """Names of all objectives."""
        return tuple(group.name for group in self.groups)

    @property
    def num_objectives(self) -> int:
        """K critics: one an objective, or one for the sum of all rewards."""
        return len(self.objectives) if self.config.multi_objective else 1

    def init(self, world: CompositeWorld, key: jax.Array, num_envs: int) -> CompositeState:
        """B fresh episodes."""
        key_start, key_state = jax.random.split(key)
        row = self._draw(world, key_start, num_envs)
        return self.start(world, row).replace(key=key_state)

    def start(self, world: CompositeWorld, row: jax.Array) -> CompositeState:
        """Episodes from rows [B] of the start states."""
        starts = take(world.starts, row)
        return CompositeState(
            physics=starts.physics,
            observation=observe(starts.history[:, 1:]),
            history=starts.history,
            step=jnp.zeros(row.shape, jnp.int32),
            key=None,
        )

    def step(
        self, world: CompositeWorld, state: CompositeState, action: jax.Array
    ) -> tuple[CompositeState, StepOutput]:
        """One control step; episodes that end start anew."""
        key_next, key_reset = jax.random.split(state.key)
        after, output = self.advance(world, state, action)
        drawn = self._draw(world, key_reset, action.shape[0])
        done = output.terminated | output.truncated
        after = replace_rows(
            after.replace(key=None), done, lambda i: self.start(world, drawn[i]), _RESET_CHUNK
        ).replace(key=key_next)
        return after, output.replace(observation=after.observation)

    def advance(
        self, world: CompositeWorld, state: CompositeState, action: jax.Array
    ) -> tuple[CompositeState, StepOutput]:
        """One control step without resets; `observation` is the final one."""
        target = world.target_centre + world.target_scale * action
        target = jnp.clip(target, world.target_lower, world.target_upper)
        physics = self.engine.step(state.physics, target)
        finite = physics.kinematics.finite
        frame = jnp.where(finite[:, None, None], link_state(physics.kinematics), 0.0)
        history = jnp.concatenate([state.history[:, 1:], frame[:, None]], axis=1)
        state = CompositeState(
            physics=physics,
            observation=observe(history[:, 1:]),
            history=history,
            step=state.step + 1,
            key=state.key,
        )
        fallen = finite & self.has_fallen(physics.kinematics)
        terminated = fallen | ~finite
        last = round(self.config.episode_s / self.engine.control_dt)
        windows = self.windows(history)
        ended = jnp.where(terminated, self.config.end_reward, 0.0)
        output = StepOutput(
            observation=state.observation,
            final_observation=state.observation,
            reward=jnp.tile(ended[:, None], (1, len(self.objectives))),
            terminated=terminated,
            truncated=~terminated & (state.step >= last),
            metrics=self._metrics(world, windows, fallen, finite),
            episode={"steps": state.step.astype(jnp.float32)},
            extras=windows,
        )
        return state, output

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

    def _metrics(
        self,
        world: CompositeWorld,
        windows: dict[str, jax.Array],
        fallen: jax.Array,
        finite: jax.Array,
    ) -> dict[str, jax.Array]:
        gaps = {
            f"pose_gap_{group.name}_m": nearest(
                world.references[group.name], group, windows[group.name]
            )
            for group in self.groups
        }
        causes = {"ended_fall": fallen, "ended_not_finite": ~finite}
        return gaps | {name: cause.astype(jnp.float32) for name, cause in causes.items()}

    def _draw(self, world: CompositeWorld, key: jax.Array, num_envs: int) -> jax.Array:
        return jax.random.randint(key, (num_envs,), 0, len(world.starts.history))


def link_state(kinematics: Kinematics) -> jax.Array:
    """One frame of the history [B, L, LINK_STATE]."""
    return jnp.concatenate(
        [
            kinematics.link_position,
            kinematics.link_quaternion,
            kinematics.link_linear_velocity,
            kinematics.link_angular_velocity,
        ],
        axis=-1,
    )


def observe(history: jax.Array) -> jax.Array:
    """The observation [B, F * L * LINK_STATE] of frames [B, F, L, LINK_STATE] [C equation 4].

    All frames are in the heading frame of the newest root, with the origin below it on z = 0.
    """
    position, quaternion = history[..., :3], history[..., 3:7]
    linear, angular = history[..., 7:10], history[..., 10:]
    origin = position[:, -1:, :1] * jnp.array([1.0, 1.0, 0.0])
    to_heading = rotation.conjugate(rotation.heading(quaternion[:, -1:, :1]))
    blocks = [
        rotation.rotate(to_heading, position - origin),
        rotation.canonical(rotation.multiply(to_heading, quaternion)),
        rotation.rotate(to_heading, linear),
        rotation.rotate(to_heading, angular),
    ]
    return jnp.concatenate(blocks, axis=-1).reshape(len(history), -1)
