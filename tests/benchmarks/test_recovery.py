"""benchmarks/recovery.py counts a fall as got up from only where the body stood by itself."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import recovery


class Scripted:
    """A character that goes through phases, and says what it said in the last of them."""

    def __init__(self, phases: list[str], words: str) -> None:
        self.phases, self.words = phases, words
        self.pushed = 0

    def restart(self) -> None:
        self.left = list(self.phases)

    def push(self, yaw: float) -> None:
        assert 0.0 <= yaw <= 2.0 * np.pi
        self.pushed += 1

    def step(self) -> SimpleNamespace:
        phase = self.left.pop(0) if len(self.left) > 1 else self.left[0]
        return SimpleNamespace(said={"phase": phase, "words": self.words})


FALLS = ["acts"] * 50 + ["lies"] * 30 + ["rises"] * 90


@pytest.mark.parametrize(
    ("phases", "words", "stood"),
    [
        ([*FALLS, "acts"], "It stood up by itself", True),
        ([*FALLS, "acts"], "It did not manage to stand up: it was put back on its feet", False),
        ([*FALLS, "acts"], "The simulation failed: it was put back on its feet", False),
        (["acts"], "", False),  # what never falls is not got up from
        (["acts", "lies"], "It fell", False),
    ],
)
def test_a_fall_counts_where_it_stands_by_itself(phases, words, stood):
    character = Scripted(phases, words)
    assert recovery.fall(character, np.random.default_rng(0)) is stood
    assert character.pushed >= 1 or phases == ["acts", "lies"]


def test_it_is_pushed_only_while_it_acts():
    character = Scripted([*FALLS, "acts"], "It stood up by itself")
    recovery.fall(character, np.random.default_rng(0))
    assert character.pushed == 2  # of 50 steps, every 20


def test_a_row_has_the_share_and_its_interval():
    assert recovery.line("walk", [True] * 9 + [False]) == (
        "walk          90.0% (60% to 98%) of 10 falls got up from"
    )
    assert recovery.line("walk", []).endswith("no fall")
