from __future__ import annotations

import types

import numpy as np
import pytest

from getup_jax.editor.verdict import outcome, verdict

STEPS = 30


def motion(*, success=False, reward=1.0, ended=STEPS, gap=(0.0, 0.0, 0.0), later=(0.0, 0.0, 0.0)):
    """An episode of a second whose features are `gap` off the curves, and `later` at the end."""
    target = np.tile([1.4, np.pi / 2, np.pi / 2], (STEPS, 1))
    features = target + np.array(gap)
    features[-1] = target[-1] + np.array(later)
    frames = types.SimpleNamespace(running=np.arange(STEPS) < ended, features=features)
    return types.SimpleNamespace(
        scores={"success": float(success), "stand_time_s": 0.7},
        frames=frames,
        target=target,
        task_reward=np.full(STEPS, reward),
        time=(1 + np.arange(STEPS)) / 30,
    )


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"success": True}, "stands after 0.7 s"),
        ({}, "does not stand at the end"),
        ({"ended": 15, "later": (-1.0, 0, 0)}, "fails at 0.5 s: head on the floor"),
        (
            {"ended": 15, "reward": 0.01, "gap": (-0.4, 0.1, 0), "later": (-1, 0, 0)},
            "too far from the curves at 0.5 s (neck 0.40 m too low)",
        ),
        (
            {"ended": 15, "reward": 0.01, "gap": (0.05, 0.1, 1.0), "later": (0, 2, 0)},
            "too far from the curves at 0.5 s (lean forward 57° off)",
        ),
        (
            {"ended": 15, "reward": 0.01, "gap": (0, -1.0, 0.0), "later": (0.05, 0, 0)},
            "too far from the curves at 0.5 s (lean to the side 57° off); it stands up all the "
            "same, by its own way",
        ),
    ],
)
def test_an_episode_in_a_few_words(values, words):
    assert verdict(motion(**values)) == words


@pytest.mark.parametrize(
    ("values", "success", "stands"),
    [
        ({"success": True, "later": (-1.0, 0, 0)}, True, True),
        ({"ended": 15, "later": (0.05, 0, 0)}, False, True),
        ({"ended": 15, "later": (-1.0, 0, 0)}, False, False),
        ({}, False, False),  # it ends where the curves do, and does not stand there for long enough
    ],
)
def test_the_page_is_told_apart_what_stands_and_what_stands_as_asked(values, success, stands):
    found = outcome(motion(**values))
    assert (found["success"], found["stands"]) == (success, stands)
    assert (", by its own way" in found["verdict"]) == (stands and not success)
