"""How an episode ended, in a few words."""

from __future__ import annotations

import numpy as np

from getup_jax.editor.simulate import Motion

_LOW = 0.1  # of the task reward: what ends an episode is that it stays below
_BEFORE = 3  # steps at the end that say why
_NEAR_M, _NEAR_RAD = 0.15, np.radians(30.0)  # as near to the curves' end the body stands


def verdict(motion: Motion) -> str:
    """Whether the body stands, or when and why the episode ended."""
    if motion.scores["success"] == 1.0:
        return f"stands after {motion.scores['stand_time_s']:.1f} s"
    ended = int(motion.frames.running.sum())
    if ended == len(motion.time):
        return "does not stand at the end"
    time = motion.time[max(ended - 1, 0)]
    if motion.task_reward[max(0, ended - _BEFORE) : ended].max(initial=0.0) >= _LOW:
        return f"fails at {time:.1f} s: head on the floor{_later(motion)}"
    return (
        f"too far from the curves at {time:.1f} s ({_farthest(motion, ended - 1)}){_later(motion)}"
    )


def outcome(motion: Motion) -> dict[str, bool | str]:
    """What a page is told; `stands` is true, too, where the body does though the episode failed."""
    success = motion.scores["success"] == 1.0
    ended_early = not motion.frames.running.all()
    stands = success or (ended_early and stands_at_end(motion))
    return {"success": success, "stands": stands, "verdict": verdict(motion)}


def _later(motion: Motion) -> str:
    """What becomes of the body after the episode's end."""
    return "; it stands up all the same, by its own way" if stands_at_end(motion) else ""


def stands_at_end(motion: Motion) -> bool:
    """Whether the last frame is where the curves end."""
    height, *angles = np.abs(motion.frames.features[-1] - motion.target[-1])
    return bool(height < _NEAR_M and max(angles) < _NEAR_RAD)


def _farthest(motion: Motion, frame: int) -> str:
    """The feature that is farthest from its curve in a frame, and how far."""
    gap = motion.frames.features[frame] - motion.target[frame]
    height, side, front = gap[0], *np.degrees(gap[1:])
    if abs(height) / _NEAR_M >= max(abs(side), abs(front)) / np.degrees(_NEAR_RAD):
        return f"neck {abs(height):.2f} m too {'high' if height > 0 else 'low'}"
    name, angle = ("lean to the side", side) if abs(side) > abs(front) else ("lean forward", front)
    return f"{name} {abs(angle):.0f}° off"
