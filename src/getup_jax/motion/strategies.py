"""Which of Bohannon and Lusardi's strategies a get-up follows [P 6.2, figure 8]."""

from __future__ import annotations

import numpy as np

from getup_jax.physics.character import CharacterSpec


def classify(positions: np.ndarray, fps: float, character: CharacterSpec) -> str:
    return ""
