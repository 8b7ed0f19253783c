"""Motion groups: which links imitate which clips, and how a discriminator sees them [C 4.1]."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import jax
import jax.numpy as jnp

from getup_jax.config import CompositeConfig, ConfigError, GroupConfig
from getup_jax.config.check import did_you_mean
from getup_jax.core import quaternion as rotation
from getup_jax.physics.character import CharacterSpec

FEATURES = 7  # of a link in a frame: position (m) and rotation

# The links in every preset, with or without a side; without, both sides are in it. A character has
# some of them, and `full` is all of its links.
_ARMS = ("shoulder", "arm", "forearm", "hand")
_LEGS = ("pelvis", "thigh", "shin", "foot")
_TRUNK = ("torso", "spine_low", "spine_mid", "spine_upper", "neck", "head")
PRESETS = {
    "upper": _TRUNK + _ARMS,
    "lower": _LEGS,
    "arms": _ARMS,
    "rest": _TRUNK + _LEGS,
    "full": _TRUNK + _ARMS + _LEGS,
    "left_arm": tuple(f"{stem}_l" for stem in _ARMS),
    "right_arm": tuple(f"{stem}_r" for stem in _ARMS),
}


@dataclasses.dataclass(frozen=True)
class Group:
    """One group of one character."""

    name: str
    links: tuple[int, ...]  # indices of links
    frame: str  # heading | root
    num_frames: int  # F of a window
    speed: tuple[float, ...]  # slowest and fastest pace of the clips

    @property
    def size(self) -> int:
        """D, numbers of a frame."""
        return FEATURES * len(self.links)

    def window(self, position: jax.Array, quaternion: jax.Array) -> jax.Array:
        """What the discriminator sees [..., F, D] of F frames, the oldest first [C equation 3].

        Positions and rotations are in the root's frame of each moment (`root`), or in that of the
        newest root's heading with the origin below it on z = 0 (`heading`).

        Args:
            position: [..., F, L, 3] of all links, world (m).
            quaternion: [..., F, L, 4] of all links, link to world.
        """
        root, turn = position[..., :1, :], quaternion[..., :1, :]
        if self.frame == "heading":
            root = root[..., -1:, :, :] * jnp.array([1.0, 1.0, 0.0])
            turn = rotation.heading(turn[..., -1:, :, :])
        to_frame = rotation.conjugate(turn)
        links = jnp.asarray(self.links)
        place = rotation.rotate(to_frame, position[..., links, :] - root)
        attitude = rotation.canonical(rotation.multiply(to_frame, quaternion[..., links, :]))
        features = jnp.concatenate([place, attitude], axis=-1)
        return features.reshape(*features.shape[:-2], self.size)

    def positions(self, window: jax.Array) -> jax.Array:
        """Link positions [..., F, N, 3] of a window."""
        shape = (*window.shape[:-1], len(self.links), FEATURES)
        return window.reshape(shape)[..., :3]


def resolve_groups(config: CompositeConfig, character: CharacterSpec) -> tuple[Group, ...]:
    """The groups of a config on a character.

    Raises ConfigError where a link is unknown, in two groups, or in none, unless the config's
    `shared_links` or `free_links` say so.
    """
    groups = tuple(_group(name, part, character) for name, part in config.groups.items())
    shared = _expand(config.shared_links, character, "composite.shared_links")
    free = _expand(config.free_links, character, "composite.free_links")
    counts = [sum(link in group.links for group in groups) for link in _all(character)]
    _refuse(
        [link for link, count in enumerate(counts) if count > 1 and link not in shared],
        character,
        "in more than one group; name them in composite.shared_links, or take them out of one",
    )
    _refuse(
        [link for link, count in enumerate(counts) if count == 0 and link not in free],
        character,
        "in no group; name them in composite.free_links, or add them to one",
    )
    return groups


def objective_weights(config: CompositeConfig, objectives: Sequence[str]) -> tuple[float, ...]:
    """The weight of every objective, in order [C equation 7]; the config's must sum to 1."""
    if not config.weights:
        return (1.0 / len(objectives),) * len(objectives)
    if set(config.weights) != set(objectives):
        raise ConfigError(
            f"composite.weights: expected one of each of {', '.join(objectives)}, got "
            f"{', '.join(config.weights)}"
        )
    total = sum(config.weights.values())
    if abs(total - 1.0) > 1e-6 or min(config.weights.values()) < 0:
        raise ConfigError(
            f"composite.weights: expected weights of at least 0 that sum to 1, got {total:g}"
        )
    return tuple(config.weights[name] for name in objectives)


def _group(name: str, config: GroupConfig, character: CharacterSpec) -> Group:
    key = f"composite.groups.{name}.links"
    links = sorted(_expand(config.links, character, key))
    if not links:
        raise ConfigError(f"{key}: expected links or a preset of {', '.join(PRESETS)}, got none")
    return Group(name, tuple(links), config.frame, config.history + 2, config.speed)


def _expand(names: Iterable[str], character: CharacterSpec, key: str) -> set[int]:
    """Links by name or by preset."""
    known = character.link_names
    found: set[int] = set()
    for name in names:
        if name in PRESETS:
            part = PRESETS[name]
            found |= {i for i in _all(character) if known[i] in part or _stem(known[i]) in part}
        elif name in known:
            found.add(known.index(name))
        else:
            hint = did_you_mean(name, [*known, *PRESETS], "; ")
            raise ConfigError(
                f"{key}: {name!r} is no link{hint} Expected a preset ({', '.join(PRESETS)}) or "
                f"one of {', '.join(known)}"
            )
    return found


def _stem(link: str) -> str:
    """The name of a link without its side."""
    return link.removesuffix("_l").removesuffix("_r")


def _all(character: CharacterSpec) -> range:
    return range(len(character.link_names))


def _refuse(links: Sequence[int], character: CharacterSpec, problem: str) -> None:
    if links:
        names = ", ".join(character.link_names[link] for link in links)
        raise ConfigError(f"composite.groups: {names}: {problem}")
