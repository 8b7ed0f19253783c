"""What a curriculum has learned about the starts of a batch of episodes."""

from __future__ import annotations

import jax
from flax import struct

from getup_jax.envs.getup.curriculum.regions import RegionProgress


@struct.dataclass
class CurriculumState:
    """Of the whole batch; None: that part is switched off. See start_prioritisation.py."""

    success: jax.Array | None = None  # [3 R, G, BINS] success rates of the starts, by cell
    wrench: jax.Array | None = None  # [3 R, G, BINS] levels of the assistive wrench
    regions: RegionProgress | None = None  # which regions of irregular ground are open
