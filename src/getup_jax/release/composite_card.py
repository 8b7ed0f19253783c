"""What a model card says of a policy of composite motion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from getup_jax.runtime.checkpoint import LoadedPolicy

PURPOSE = """\
A policy of getup_jax for composite motion: body parts imitate clips, beside goals
(docs/composite.md). This folder holds its weights and every setting (config.yaml);
checkpoint.json has a digest of each file."""
MEANING = """\
Without action noise, from the clips' poses. Imitation error: mean link distance to the clip after
dynamic time warping, mean and standard deviation over episodes; travel: how far the links move, as
a share of what they do in the clips."""


def data(loaded: LoadedPolicy) -> dict[str, str]:
    """What it was trained on: the clips of every group, the goals, and a policy before it."""
    composite = loaded.config.composite
    assert composite is not None
    clips = {name: ", ".join(group.clips) for name, group in composite.groups.items()}
    found = {"clips": "; ".join(f"{name}: {text}" for name, text in clips.items())}
    if composite.goals:
        found["goals"] = ", ".join(composite.goals)
    if composite.meta:
        found["meta policy"] = composite.meta
    return found


def numbers(result: Mapping[str, Any]) -> str:
    """One evaluation by `getup-eval --json`: its groups, then its goals."""
    lines = [f"{result['episodes']} episodes:", ""]
    lines += ["| group | imitation error m | travel |", "|---|---|---|"]
    for name, error in result["imitation_error_m"].items():
        lines.append(
            f"| {name} | {error['mean']:.3f} ± {error['std']:.3f} | {error['travel']:.2f} |"
        )
    if result["goals"]:
        lines += ["", "| goal | mean reward | attempts that succeed |", "|---|---|---|"]
    for name, goal in result["goals"].items():
        success = "-" if goal["success"] is None else f"{goal['success']:.0%}"
        lines.append(f"| {name} | {goal['reward']:.3f} | {success} |")
    falls = f"{result['fall_share']:.0%} of the episodes have a fall"
    if len(result["imitation_error_m"]) > 1:
        falls += f"; the largest error is {result['ratio']:.1f} times the smallest"
    return "\n".join([*lines, "", f"{falls}."])


def limits() -> list[str]:
    """What holds for every such policy."""
    return [
        "Episodes start in poses of its clips, on a plane; it knows no pushes and no other starts.",
        "One seed; its goals are drawn as config.yaml says, others need an evaluation first.",
    ]
