"""What an iteration takes on more devices than were measured: the formulas of docs/scale.md."""

from __future__ import annotations

import dataclasses
import math


@dataclasses.dataclass(frozen=True)
class Network:
    """What connects the devices."""

    latency_s: float  # of one message
    bytes_per_s: float  # of one device, either way


@dataclasses.dataclass(frozen=True)
class Iteration:
    """One device's part of a training iteration."""

    compute_s: float  # with nobody to wait for
    gradient_bytes: float  # of a message, on average: the actor's gradient and the critic's
    updates: int  # messages with gradients


def reduction_s(size: float, devices: int, network: Network) -> float:
    """Seconds of an all-reduce of `size` bytes: a tree's messages, a ring's bytes.

    2 ceil(log2 P) latency + 2 (P - 1) / P size / bandwidth    (Thakur et al. 2005, section 4)
    """
    messages = 2 * math.ceil(math.log2(devices))
    return messages * network.latency_s + 2 * (devices - 1) / devices * size / network.bytes_per_s


def iteration_s(of: Iteration, devices: int, network: Network) -> float:
    """Seconds of an iteration where every device has as much to do as the measured one."""
    if devices == 1:
        return of.compute_s
    return of.compute_s + of.updates * reduction_s(of.gradient_bytes, devices, network)


def efficiency(of: Iteration, devices: int, network: Network) -> float:
    """Samples a second of all devices, beside as many times those of one."""
    return of.compute_s / iteration_s(of, devices, network)
