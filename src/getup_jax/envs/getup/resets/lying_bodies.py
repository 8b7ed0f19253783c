"""The bodies that lying starts are made of: some were dropped, some stood and were pushed over."""

from __future__ import annotations

import dataclasses

import numpy as np

from getup_jax.config import TaskConfig
from getup_jax.core.resources import cache_dir
from getup_jax.envs.getup.resets.cache import Maker, Request, cached_starts
from getup_jax.envs.getup.resets.knock_downs import knock_down
from getup_jax.envs.getup.resets.lying import Log, Place, Starts
from getup_jax.envs.getup.resets.rag_doll import DROPS, Drop, evenly, fall
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.terrain_map import REGIONS


@dataclasses.dataclass(frozen=True, eq=False)
class LimpBodies:
    """Makes limp bodies on one ground as the config asks for, or reads them from the cache."""

    character: CharacterSpec  # with the ground in its model
    place: Place
    config: TaskConfig
    seed: int
    log: Log

    def on_the_flat(self) -> Starts | None:
        """`task.limp_drops` of them in the first region; None where `task.limp_share` is 0."""
        if self.config.limp_share == 0:
            return None
        dropped, pushed = self._numbers(self.config.limp_drops)
        first = np.arange(len(REGIONS)) == 0
        # with their number in the seed: an evaluation drops another number, so all others
        return Starts.join(
            [
                *(
                    self._dropped(drop, f"{drop.name}-flat", count * first, (self.seed, count))
                    for drop, count in self._ways(dropped)
                ),
                self._pushed("pushed-flat", pushed * first, None),
            ]
        )

    def on_slopes(self, count: int, standing: Starts) -> Starts:
        """`count` of them, equally many in every irregular region; standing: what may be pushed."""
        dropped, pushed = self._numbers(count)
        return Starts.join(
            [
                *(
                    self._dropped(drop, drop.name, evenly(number), self.seed)
                    for drop, number in self._ways(dropped)
                ),
                self._pushed("pushed", evenly(pushed), standing),
            ]
        )

    def _numbers(self, count: int) -> tuple[int, int]:
        """How many of `count` bodies are dropped and how many are pushed over."""
        pushed = round(self.config.fallen_share * count)
        return count - pushed, pushed

    def _ways(self, dropped: int) -> list[tuple[Drop, int]]:
        """The ways in which the config has bodies dropped, and how many fall in each."""
        drops = DROPS[self.config.drop_as]
        return [
            (drop, dropped // len(drops) + (i < dropped % len(drops)))
            for i, drop in enumerate(drops)
        ]

    def _dropped(
        self, drop: Drop, name: str, wanted: np.ndarray, seed: int | tuple[int, int]
    ) -> Starts:
        def make(request: Request, log: Log) -> Starts:
            rng = np.random.default_rng(seed)
            return fall(self.character, self.place, wanted, drop, rng, log)

        return self._cached(name, wanted, make)

    def _pushed(self, name: str, wanted: np.ndarray, standing: Starts | None) -> Starts:
        def make(request: Request, log: Log) -> Starts:
            rng = np.random.default_rng((request.seed, request.count))
            return knock_down(self.character, self.place, wanted, standing, rng, log)

        return self._cached(name, wanted, make)

    def _cached(self, name: str, wanted: np.ndarray, make: Maker) -> Starts:
        request = Request(name, int(wanted.sum()), self.seed)
        if request.count == 0:
            return Starts.none(self.character)
        return cached_starts(request, self.character, make, cache_dir() / "starts", self.log)
