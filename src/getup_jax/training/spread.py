"""A run's simulations on every device of every process."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax

from getup_jax.config import Config
from getup_jax.config.check import ConfigError
from getup_jax.config.load import dump_yaml
from getup_jax.rl.sharded import place
from getup_jax.runtime import processes
from getup_jax.runtime.processes import ProcessError
from getup_jax.runtime.run_folder import CONFIG, RunError

Iteration = Callable[[Any, Any], Any]


def check_divides(config: Config, devices: int) -> None:
    """Raise ConfigError unless every device can have the same part of what is split."""
    discriminator = None if config.composite is None else config.composite.discriminator
    split = {
        "ppo.num_envs": config.ppo.num_envs,
        "ppo.minibatch_size": config.ppo.minibatch_size,
    }
    if discriminator is not None:
        split["composite.discriminator.minibatch_size"] = discriminator.minibatch_size
    for key, value in split.items():
        if value % devices:
            fewer = "or use fewer devices, as with CUDA_VISIBLE_DEVICES=0"
            raise ConfigError(
                f"{key}: expected a multiple of the number of devices, {devices}, got {value}; "
                f"set {key}={value + devices - value % devices}, {fewer}"
            )


def check_shared(config: Config, folder: Path) -> None:
    """Raise an error in all processes unless they have the same settings and see one folder."""
    own = zlib.crc32(dump_yaml(config).encode())
    file = folder / CONFIG
    seen = zlib.crc32(file.read_bytes()) if file.is_file() else 0
    settings, folders = processes.gathered([own, seen]).T
    for index in range(1, len(settings)):
        if settings[index] != settings[0]:
            hint = "start all with the same CONFIG and key=value"
            raise ProcessError(f"process {index} has other settings than process 0; {hint}")
        if folders[index] != folders[0]:
            hint = "--run must name a folder on storage that all machines share"
            raise RunError(f"{folder}: process {index} does not see what process 0 wrote; {hint}")


def spread(learner: Any, world: Any, state: Any) -> tuple[Iteration, Any, Any]:
    """The iteration, the world and the state on all devices; on one device as they are.

    The first process's world and learner are everybody's: machines round differently, and so would
    what they have computed until here.
    """
    devices = jax.devices()
    if len(devices) == 1:
        return learner.iteration, world, state
    _check_same(world, int(state.iteration))
    world = processes.from_first(world)
    state = state.replace(learner=processes.from_first(state.learner))
    placement = place(learner, world, devices)
    iteration = placement.spread(learner.iteration)
    return iteration, placement.put_world(world), placement.put_state(state)


def _check_same(world: Any, iteration: int) -> None:
    """Raise ProcessError in all unless all have built the same shapes, and resume at one place."""
    shapes = str(jax.tree.map(lambda x: (x.shape, str(x.dtype)), world))
    found = processes.gathered([zlib.crc32(shapes.encode()), iteration])
    for index, (own, begin) in enumerate(found):
        if own != found[0, 0]:
            problem = f"process {index} has made other start states than process 0"
            hint = "machines round differently; let GETUP_JAX_CACHE name a folder that all share"
            raise ProcessError(f"{problem}; {hint}")
        if begin != found[0, 1]:
            problem = f"process {index} resumes at iteration {begin}, process 0 at {found[0, 1]}"
            raise ProcessError(f"{problem}; wait until all machines see the same files, try again")


def described() -> str:
    """The devices of the run in words: cpu, 8 x gpu, 4 x cpu in 2 processes."""
    devices = jax.devices()
    kind = devices[0].platform
    several = f"{len(devices)} x {kind}" if len(devices) > 1 else kind
    among = f" in {processes.count()} processes" if processes.count() > 1 else ""
    return several + among
