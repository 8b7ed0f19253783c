"""What an exported policy computes, as functions of one character's state; traced into ONNX.

    observation  (qpos, qvel, ground, points, duration, time, action) to the observation
    policy       observation to (servo targets, the action that the filter holds)
    start        (qpos, points, duration, time) to the action that the filter holds at first

All have a leading axis N, in the order and with the sizes that `Graph.inputs` says.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.envs.getup.action_decoder import ActionDecoder
from getup_jax.envs.getup.observation import GRID_POINTS
from getup_jax.envs.getup.task import GetUpTask
from getup_jax.motion.getup import curves
from getup_jax.physics.forward_kinematics import LinkTree, kinematics

POINTS = (curves.NUM_POINTS, 3)


@dataclasses.dataclass(frozen=True, eq=False)
class Graph:
    """A function of arrays, with the names and sizes of its arguments and results."""

    function: Callable[..., Any]
    inputs: dict[str, tuple[int, ...]]  # without the axis N
    outputs: tuple[str, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class PolicyParts:
    """What a trained policy that gets up is made of."""

    task: GetUpTask  # for its observation, filter and units
    decoder: ActionDecoder  # of its actions
    act: Callable[[jax.Array], jax.Array]  # raw observations [N, O] to actions [N, A]
    target_lower: np.ndarray  # [J] rad
    target_upper: np.ndarray  # [J] rad


class GivenGround:
    """Ground whose heights [N, 25] below the grid around the body are known."""

    def __init__(self, heights: jax.Array) -> None:
        self._heights = heights

    def height(self, xy: jax.Array) -> jax.Array:
        """The heights, whatever the place."""
        return self._heights


def graphs(parts: PolicyParts) -> dict[str, Graph]:
    """The graphs by name."""
    joints, action = parts.task.character.num_joints, (parts.task.action_size,)
    clock = {"points": POINTS, "duration": (), "time": ()}
    state = {"qpos": (7 + joints,), "qvel": (6 + joints,), "ground": (GRID_POINTS**2,)}
    return {
        "policy": Graph(
            lambda observation: _policy(parts, observation),
            {"observation": (parts.task.observation_size,)},
            ("servo_target", "action"),
        ),
        "observation": Graph(
            lambda *arguments: _observation(parts.task, *arguments),
            {**state, **clock, "action": action},
            ("observation",),
        ),
        "start": Graph(
            lambda *arguments: _start(parts, *arguments),
            {"qpos": state["qpos"], **clock},
            ("action",),
        ),
    }


def _policy(parts: PolicyParts, observation: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Servo targets [N, J] and the filtered action [N, A]; its last value is in the observation."""
    task = parts.task
    before = observation[..., task.observer.slices()["action"]]
    filtered = task.config.filter * parts.act(observation) + (1.0 - task.config.filter) * before
    condition = task.observer.condition(observation)
    target = parts.decoder.target(filtered, condition)
    return jnp.clip(target, parts.target_lower, parts.target_upper), filtered


def _observation(
    task: GetUpTask,
    qpos: jax.Array,
    qvel: jax.Array,
    ground: jax.Array,
    *clock_and_action: jax.Array,
) -> jax.Array:
    """See `Observer.observe`."""
    points, duration, time, action = clock_and_action
    seen: Any = GivenGround(ground)
    links = kinematics(LinkTree.of(task.character), qpos, qvel)
    posture = task.observer.posture(links, seen)
    return task.observer.observe(posture, _targets(task, points, duration, time), action)


def _start(
    parts: PolicyParts, qpos: jax.Array, points: jax.Array, duration: jax.Array, time: jax.Array
) -> jax.Array:
    """The action [N, A] whose servo target is the pose [N, 7 + J] itself."""
    task = parts.task
    condition = _targets(task, points, duration, time)[..., 0, :]
    return parts.decoder.first(qpos[..., 7:], condition)


def _targets(task: GetUpTask, points: jax.Array, duration: jax.Array, time: jax.Array) -> jax.Array:
    """Curve values [N, n, 3] at the look-ahead times."""
    ahead = jnp.asarray(task.config.lookahead_s, jnp.float32)
    s = (time[..., None] + ahead) / duration[..., None]
    return curves.evaluate(points[..., None, :, :], s)
