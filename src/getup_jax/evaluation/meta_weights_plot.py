"""How much a policy relies on its meta policy, by body part [C figures 7 and 8]."""

from __future__ import annotations

import copy
import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from getup_jax.config import CompositeConfig, ConfigError
from getup_jax.core.output_file import replacing
from getup_jax.evaluation.composite_rollout import CompositeEpisodes
from getup_jax.evaluation.film import render
from getup_jax.evaluation.plot import require
from getup_jax.physics.character import CharacterSpec

PICTURES = 5  # of the first episode
BINS = 40
_SIZE = (320, 240)  # rows, columns of a picture
_PARTS = {  # stems of the links whose hinges they have
    "trunk": ("torso", "spine_low", "spine_mid", "spine_upper", "neck", "head"),
    "arm": ("shoulder", "arm", "forearm", "hand"),
    "leg": ("pelvis", "thigh", "shin", "foot"),
}
_SIDES = {"_l": "left", "_r": "right"}


def check(config: CompositeConfig) -> None:
    """Raises ConfigError where a policy has no meta policy."""
    if config.meta is None:
        raise ConfigError(
            "--plot: draws the weights of a meta policy's actions, and this policy has none; "
            "train one with composite.meta, or leave --plot out"
        )


def parts(character: CharacterSpec) -> dict[str, np.ndarray]:
    """Which hinges [J] bool belong to the trunk, each arm and each leg."""
    found: dict[str, list[int]] = {}
    for hinge, link in enumerate(character.joint_link):
        name = character.link_names[link]
        side = _SIDES.get(name[-2:], "")
        stem = name[:-2] if side else name
        (part,) = [part for part, stems in _PARTS.items() if stem in stems]
        found.setdefault(f"{side} {part}".strip(), []).append(hinge)
    hinges = np.arange(len(character.joint_link))
    return {part: np.isin(hinges, own) for part, own in sorted(found.items())}


def plot_weights(path: Path, character: CharacterSpec, episodes: CompositeEpisodes) -> None:
    """Write the distribution of w of every part, above pictures coloured by it.

    Raises ConfigError where matplotlib is missing; without a renderer the pictures are left out,
    with a warning.
    """
    assert episodes.meta_weight is not None, "see `check`"
    pyplot = require()
    colours = pyplot.get_cmap("coolwarm")
    images = _pictures(character, episodes, colours)
    rows = parts(character)
    figure = pyplot.figure(figsize=(7.5, 1.0 * len(rows) + 3.0), layout="constrained")
    axes = figure.subplots(
        len(rows) + 1, 1, height_ratios=[1.0] * len(rows) + [2.2 if images else 0.05]
    )
    for axis, (part, hinges) in zip(axes, rows.items(), strict=False):
        _draw(axis, part, episodes.meta_weight[..., hinges], colours)
    axes[-2].set_xlabel("weight w of the meta policy's action")
    axes[-1].axis("off")
    if images:
        axes[-1].imshow(np.concatenate(images, axis=1))
        axes[-1].set_title("red: by the meta policy, blue: by itself", fontsize=8)
    with replacing(path) as part:
        figure.savefig(part, dpi=120)
    pyplot.close(figure)


def density(weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges [BINS + 1] and density [BINS] of weights of any shape; its mean over [0, 1] is 1."""
    value, edges = np.histogram(weight, bins=BINS, range=(0.0, 1.0), density=True)
    return edges, value


def _draw(axis: Any, part: str, weight: np.ndarray, colours: Any) -> None:
    edges, value = density(weight)
    centres = (edges[1:] + edges[:-1]) / 2
    axis.bar(centres, value, width=1.0 / BINS, color=colours(centres))
    axis.axvline(weight.mean(), color="k", linewidth=0.8)
    axis.set_xlim(0.0, 1.0)
    axis.set_yticks([])
    label = f"{part}\n{weight.mean():.2f}"
    axis.set_ylabel(label, rotation=0, ha="right", va="center", fontsize=8)


def _pictures(
    character: CharacterSpec, episodes: CompositeEpisodes, colours: Any
) -> list[np.ndarray]:
    """Moments of the first episode, every link in the colour of its hinges' mean weight."""
    assert episodes.meta_weight is not None
    steps = np.linspace(0, episodes.qpos.shape[1] - 1, PICTURES + 1)[1:].astype(int)
    try:
        return [
            render(
                coloured(character, episodes.meta_weight[0, step], colours),
                episodes.qpos[0, step : step + 1],
                _SIZE,
            )[0]
            for step in steps
        ]
    except ConfigError as error:
        warnings.warn(f"--plot: without pictures: {error}", RuntimeWarning, stacklevel=3)
        return []


def coloured(character: CharacterSpec, weight: np.ndarray, colours: Any) -> mujoco.MjModel:
    """The model with the geoms of every link that has hinges in the colour of their weight [J]."""
    model = copy.copy(character.model)
    links = np.asarray(character.joint_link)
    for geom, body in enumerate(model.geom_bodyid):
        own = weight[links == body - 1]
        if len(own):
            model.geom_matid[geom] = -1
            model.geom_rgba[geom] = colours(float(own.mean()))
    return model
