"""A learner's iteration on many devices: every device has a part of the simulations.

One mesh with one axis spans the devices of all processes. Networks, optimisers, statistics and what
an environment keeps of the whole batch are the same on every device; simulations are split. The
code of an iteration is that of one device: where it reduces over simulations it calls
core/device_axis.py.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from getup_jax.core.device_axis import AXIS
from getup_jax.rl.learner import Learner
from getup_jax.rl.state import TrainState

SAME, SPLIT = PartitionSpec(), PartitionSpec(AXIS)

Iteration = Callable[[Any, TrainState], tuple[TrainState, dict[str, jax.Array]]]


@dataclasses.dataclass(frozen=True)
class Placement:
    """A mesh, and how a training state lies on it."""

    mesh: Mesh
    specs: TrainState  # a PartitionSpec for every array of the state

    def put_world(self, world: Any) -> Any:
        """Arrays of this process, the same in all, as arrays that every device has."""
        return jax.tree.map(lambda x: put(x, NamedSharding(self.mesh, SAME)), world)

    def put_state(self, state: TrainState) -> TrainState:
        """A whole state of this process, the same in all, spread over the devices.

        An array without elements lies on all of them, as XLA returns it: placed otherwise, the
        second iteration would be another program.
        """

        def spread(x: Any, spec: PartitionSpec) -> jax.Array:
            return put(x, NamedSharding(self.mesh, spec if np.size(x) else SAME))

        return jax.tree.map(spread, state, self.specs)

    def spread(self, iteration: Iteration) -> Iteration:
        """The iteration of `put_world`'s and `put_state`'s arrays; jit it and donate the state."""
        return jax.shard_map(
            iteration,
            mesh=self.mesh,
            in_specs=(SAME, self.specs),
            out_specs=(self.specs, SAME),
            # What the axis is summed over is said in device_axis.py; JAX's own check would need it
            # of every carry of every loop, too.
            check_vma=False,
        )


def place(learner: Learner, world: Any, devices: Sequence[Any]) -> Placement:
    """The mesh of these devices, and the learner's state on it."""
    return Placement(Mesh(np.array(devices), (AXIS,)), state_specs(learner, world))


def state_specs(learner: Learner, world: Any) -> TrainState:
    """Which arrays of the learner's `TrainState` are split, along their first axis."""
    shapes = jax.eval_shape(learner.init_learner, jax.random.PRNGKey(0))
    specs = jax.tree.map(lambda _: SAME, shapes)
    same: Any = SAME
    return TrainState(specs, environment_specs(learner, world), key=same, iteration=same)


def environment_specs(learner: Learner, world: Any) -> Any:
    """Split is what grows with the number of simulations; the rest is of the whole batch."""

    def shapes(num_envs: int) -> Any:
        def init(world: Any, key: jax.Array) -> Any:
            return learner.init_environment(world, key, num_envs)

        return jax.eval_shape(init, world, jax.random.PRNGKey(0))

    def spec(two: jax.ShapeDtypeStruct, three: jax.ShapeDtypeStruct) -> PartitionSpec:
        if two.shape == three.shape:
            return SAME
        assert (two.shape[0], three.shape[0]) == (2, 3), "simulations are the first axis"
        return SPLIT

    return jax.tree.map(spec, shapes(2), shapes(3))


def put(x: Any, sharding: NamedSharding) -> jax.Array:
    """An array that this process has in full, as one over the devices of all processes."""
    whole = np.asarray(x)
    return jax.make_array_from_callback(whole.shape, sharding, lambda index: whole[index])
