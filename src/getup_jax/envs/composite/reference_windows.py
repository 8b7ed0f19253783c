"""Windows of the reference clips at random times and paces, sampled inside jit."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct

from getup_jax.config import ConfigError
from getup_jax.envs.composite.groups import Group
from getup_jax.motion.authoring.loops import repeated
from getup_jax.motion.clips import Clip
from getup_jax.physics.character import CharacterSpec

_POSES = 256  # frames that `nearest` looks at, at most
_WINDOWS = 1024  # that the clips' mean travel is taken over


@struct.dataclass
class References:
    """The frames of a group's C clips, one after the other."""

    position: jax.Array  # [M, L, 3] of all links, world (m)
    quaternion: jax.Array  # [M, L, 4]
    first: jax.Array  # [C] int32 first frame of each clip
    fps: jax.Array  # [C]
    duration: jax.Array  # [C] s
    poses: jax.Array  # [Q, N, 3] some frames' positions, as in the newest frame of a window
    travel: jax.Array  # [] m, mean of `travel` over the clips' windows


def make_references(
    clips: Sequence[Clip], group: Group, character: CharacterSpec, control_dt: float
) -> References:
    """The table of a group's clips; loops are unrolled so that windows cross their seam.

    Raises ConfigError where a clip is of another skeleton or too short.
    """
    key = f"composite.groups.{group.name}.clips"
    if not clips:
        raise ConfigError(f"{key}: expected at least one clip, got none")
    for clip in clips:
        _check(clip, group, character, control_dt, key)
    clips = [repeated(clip, 2) for clip in clips]
    counts = [len(clip.qpos) for clip in clips]
    position, quaternion = link_poses(np.concatenate([clip.qpos for clip in clips]), character)
    found = References(
        position=jnp.asarray(position),
        quaternion=jnp.asarray(quaternion),
        first=jnp.asarray(np.cumsum([0, *counts[:-1]]), jnp.int32),
        fps=jnp.asarray([clip.fps for clip in clips], jnp.float32),
        duration=jnp.asarray([clip.duration for clip in clips], jnp.float32),
        poses=jnp.zeros((0, len(group.links), 3)),
        travel=jnp.zeros(()),
    )
    poses, mean_travel = _statistics(found, group, control_dt)
    return found.replace(poses=poses, travel=mean_travel)


@functools.partial(jax.jit, static_argnums=(1, 2))
def _statistics(
    references: References, group: Group, control_dt: float
) -> tuple[jax.Array, jax.Array]:
    """Some poses [n, N, 3] of the clips, see `nearest`, and the mean `travel` of windows."""
    total = len(references.position)
    some = np.linspace(0, total - 1, min(_POSES, total)).astype(int)
    pose = group.window(references.position[some, None], references.quaternion[some, None])
    windows = sample(references, group, jax.random.PRNGKey(0), _WINDOWS, control_dt)
    return group.positions(pose)[:, 0], jnp.mean(travel(group, windows))


def sample(
    references: References, group: Group, key: jax.Array, count: int, control_dt: float
) -> jax.Array:
    """`count` windows [count, F, D] at random, all moments of all clips alike."""
    key_clip, key_time, key_speed = jax.random.split(key, 3)
    speed = jax.random.uniform(key_speed, (count,), minval=group.speed[0], maxval=group.speed[1])
    chance = references.duration / jnp.sum(references.duration)
    clip = jax.random.choice(key_clip, len(chance), (count,), p=chance)
    span = speed * control_dt * (group.num_frames - 1)
    start = jax.random.uniform(key_time, (count,)) * (references.duration[clip] - span)
    return window_at(references, group, clip, start, speed * control_dt)


def window_at(
    references: References, group: Group, clip: jax.Array, start: jax.Array, period: jax.Array
) -> jax.Array:
    """Windows [n, F, D] of clips [n] from times start [n] (s), frames `period` [n] (s) apart."""
    steps = jnp.arange(group.num_frames, dtype=jnp.float32)
    time = start[:, None] + period[:, None] * steps
    place = jnp.clip(time * references.fps[clip][:, None], 0.0)
    last = jnp.round(references.duration * references.fps).astype(jnp.int32)[clip][:, None]
    low = jnp.minimum(jnp.floor(place).astype(jnp.int32), last - 1)
    share = (place - low)[..., None, None]
    row = references.first[clip][:, None] + low
    position = _between(references.position, row, share)
    return group.window(position, _turn_between(references.quaternion, row, share))


def likeness(references: References, group: Group, windows: jax.Array) -> dict[str, jax.Array]:
    """Distance [B] of windows [B, F, D] to the nearest pose of the clips (m), and their travel [B].

    The latter is a share of what the clips do. A character that stands still in one of their poses
    has no distance, and no travel.
    """
    return {
        f"pose_gap_{group.name}_m": nearest(references, group, windows),
        f"travel_{group.name}": travel(group, windows) / jnp.maximum(references.travel, 1e-6),
    }


def nearest(references: References, group: Group, window: jax.Array) -> jax.Array:
    """Mean distance [B] (m) of a window's newest links to the nearest pose of the clips.

    It ignores the order in time: a lower bound of the imitation error of equation 11.
    """
    newest = group.positions(window)[..., -1, :, :]
    gap = jnp.linalg.norm(newest[:, None] - references.poses, axis=-1)
    return jnp.min(jnp.mean(gap, axis=-1), axis=-1)


def travel(group: Group, window: jax.Array) -> jax.Array:
    """How far [B] (m) a link comes from a window's oldest frame to its newest, mean over links."""
    position = group.positions(window)
    gap = jnp.linalg.norm(position[..., -1, :, :] - position[..., 0, :, :], axis=-1)
    return jnp.mean(gap, axis=-1)


def link_poses(qpos: np.ndarray, character: CharacterSpec) -> tuple[np.ndarray, np.ndarray]:
    """Positions [M, L, 3] and quaternions [M, L, 4] of the links in poses [M, 7 + J], float32."""
    data, links = mujoco.MjData(character.model), len(character.link_names)
    position = np.empty((len(qpos), links, 3), np.float32)
    quaternion = np.empty((len(qpos), links, 4), np.float32)
    for frame, pose in enumerate(qpos):
        data.qpos[:] = pose
        mujoco.mj_kinematics(character.model, data)
        position[frame], quaternion[frame] = data.xpos[1:], data.xquat[1:]
    return position, quaternion


def _between(table: jax.Array, row: jax.Array, share: jax.Array) -> jax.Array:
    return (1.0 - share) * table[row] + share * table[row + 1]


def _turn_between(table: jax.Array, row: jax.Array, share: jax.Array) -> jax.Array:
    """Normalised linear interpolation; neighbouring frames differ by little."""
    before, after = table[row], table[row + 1]
    same_side = jnp.sum(before * after, axis=-1, keepdims=True) >= 0.0
    mixed = (1.0 - share) * before + share * jnp.where(same_side, after, -after)
    return mixed / jnp.linalg.norm(mixed, axis=-1, keepdims=True)


def _check(clip: Clip, group: Group, character: CharacterSpec, control_dt: float, key: str) -> None:
    expected = 7 + character.num_joints
    if clip.qpos.shape[1] != expected:
        raise ConfigError(
            f"{key}: {clip.name}: its poses have {clip.qpos.shape[1]} numbers, expected {expected} "
            "of this character; import its source again for it"
        )
    span = control_dt * (group.num_frames - 1) * group.speed[1]
    if clip.duration <= span:
        raise ConfigError(
            f"{key}: {clip.name}: lasts {clip.duration:.3f} s, expected more than the {span:.3f} s "
            f"of a window of {group.num_frames} frames; lower history or speed, or take a longer "
            "clip"
        )
