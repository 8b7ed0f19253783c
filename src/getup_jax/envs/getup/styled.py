"""Getting up with an objective a reward term, and with discriminators for its style.

The same task as `GetUpTask`; only what its rewards are, and the windows for discriminators, are
added. Its learner, discriminators and switches are those of composite motion.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.config import CompositeConfig, Config, ConfigError
from getup_jax.core import quaternion as rotation
from getup_jax.core.types import Kinematics, StepOutput
from getup_jax.envs.composite.groups import Group, objective_weights, resolve_groups
from getup_jax.envs.composite.reference_windows import References, make_references, nearest
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.envs.getup.drawn_curves import Curve
from getup_jax.envs.getup.episode import EpisodeState
from getup_jax.envs.getup.task import GetUpTask, World
from getup_jax.motion.named_clips import named_clips

POSE = 7  # of a link in a frame: position 3, quaternion 4
TERMS = ("total", "task", "height", "orientation", "velocity", "posture", "natural")


@struct.dataclass
class StyledWorld(World):
    """The task's arrays, and the clips of every group."""

    references: dict[str, References] = struct.field(default_factory=dict)


@dataclasses.dataclass(frozen=True, eq=False)
class StyledGetUp(GetUpTask):
    """The get-up task with K objectives: imitations, then reward terms."""

    groups: tuple[Group, ...] = ()
    composite: CompositeConfig = dataclasses.field(default_factory=CompositeConfig)

    @property
    def objectives(self) -> tuple[str, ...]:
        """Names of all objectives: imitations, then reward terms."""
        return (*(group.name for group in self.groups), *self.composite.terms)

    @property
    def num_objectives(self) -> int:
        """K critics: one an objective, or one for the sum of all rewards."""
        return len(self.objectives) if self.composite.multi_objective else 1

    def start(
        self,
        world: World,
        getup: jax.Array,
        kind: jax.Array,
        row: jax.Array,
        curve: Curve | None = None,
        region: jax.Array | None = None,
    ) -> EpisodeState:
        """See `GetUpTask.start`; the frames before the start go on with its velocities."""
        state = super().start(world, getup, kind, row, curve, region)
        if not self.groups:
            return state
        return state.replace(history=self._before(state.physics.kinematics))

    def advance(
        self, world: World, state: EpisodeState, action: jax.Array
    ) -> tuple[EpisodeState, StepOutput]:
        """See `GetUpTask.advance`; imitation rewards are 0 until a discriminator gives them."""
        before = state.history
        state, output = super().advance(world, state, action)
        none = jnp.zeros(output.terminated.shape, jnp.float32)
        failed = jnp.where(output.terminated, self.composite.end_reward, none)
        terms = [output.metrics[f"reward_{name}"] for name in self.composite.terms]
        reward = jnp.stack([*(failed for _ in self.groups), *terms], axis=-1)
        output = output.replace(reward=reward, extras={})
        if before is None:
            return state, output
        kinematics = state.physics.kinematics
        frame = jnp.where(kinematics.finite[:, None, None], _poses(kinematics), 0.0)
        history = jnp.concatenate([before[:, 1:], frame[:, None]], axis=1)
        windows = self.windows(history)
        gaps = {
            f"pose_gap_{group.name}_m": nearest(
                world.references[group.name], group, windows[group.name]
            )
            for group in self.groups
        }
        output = output.replace(extras=windows, metrics=output.metrics | gaps)
        return state.replace(history=history), output

    def windows(self, history: jax.Array) -> dict[str, jax.Array]:
        """What each group's discriminator sees, [B, F, D] by name."""
        return {
            group.name: group.window(
                history[:, -group.num_frames :, :, :3], history[:, -group.num_frames :, :, 3:]
            )
            for group in self.groups
        }

    def _before(self, kinematics: Kinematics) -> jax.Array:
        """Frames [B, F, L, POSE] that end with this one, had the links come at its velocities."""
        frames = max(group.num_frames for group in self.groups)
        age = self.engine.control_dt * jnp.arange(frames - 1, -1, -1.0)[:, None, None]
        position = kinematics.link_position[:, None]
        position = position - age * kinematics.link_linear_velocity[:, None]
        turn = _turn(-age * kinematics.link_angular_velocity[:, None])
        quaternion = rotation.multiply(turn, kinematics.link_quaternion[:, None])
        return jnp.concatenate([position, quaternion], axis=-1)


@dataclasses.dataclass(frozen=True, eq=False)
class BuiltStyled(BuiltTask):
    """A get-up task with several objectives."""

    environment: StyledGetUp


def with_objectives(config: Config, built: BuiltTask, log: Callable[[str], None]) -> BuiltStyled:
    """The built task with the objectives of `composite`.

    Raises ConfigError where a group, a clip or a weight is wrong.
    """
    composite, task = config.composite, built.environment
    assert composite is not None, "a config of one objective needs none of this"
    groups = resolve_groups(composite, task.character) if composite.groups else ()
    references = {}
    for group in groups:
        key = f"composite.groups.{group.name}.clips"
        names = composite.groups[group.name].clips
        clips = named_clips(names, task.character, key)
        if not names:
            clips = [getup.clip for getup in built.getups if getup.clip is not None]
        log(f"group {group.name}: {', '.join(clip.name for clip in clips) or 'no clips'}")
        references[group.name] = make_references(
            clips, group, task.character, task.engine.control_dt
        )
    own = {f.name: getattr(task, f.name) for f in dataclasses.fields(task)}
    styled = StyledGetUp(**own, groups=groups, composite=composite)
    if built.world.prior is None and "natural" in composite.terms:
        raise ConfigError("composite.terms: natural: there is none without a pose prior")
    objective_weights(composite, styled.objectives)  # a mistake in them is told now
    arrays = {f.name: getattr(built.world, f.name) for f in dataclasses.fields(built.world)}
    world = StyledWorld(**arrays, references=references)
    return BuiltStyled(styled, world, built.prior, built.getups)


def _poses(kinematics: Kinematics) -> jax.Array:
    """One frame [B, L, POSE]."""
    return jnp.concatenate([kinematics.link_position, kinematics.link_quaternion], axis=-1)


def _turn(vector: jax.Array) -> jax.Array:
    """Quaternions [..., 4] of rotation vectors [..., 3] (rad)."""
    angle = jnp.linalg.norm(vector, axis=-1, keepdims=True)
    axis = vector / jnp.maximum(angle, 1e-9)
    return jnp.concatenate([jnp.cos(angle / 2), axis * jnp.sin(angle / 2)], axis=-1)
