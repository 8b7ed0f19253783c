"""Reference motions for the page: link poses and features, so that one sees what a curve is of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from getup_jax.editor.simulate import link_poses
from getup_jax.motion.clips import Clip
from getup_jax.motion.getup.getups import clip_features
from getup_jax.physics.character import CharacterSpec

_FPS = 30.0  # of what the page shows, about
_DEGREES = np.array([1.0, 180.0 / np.pi, 180.0 / np.pi])


def packed(clips: Sequence[Clip], character: CharacterSpec) -> tuple[list[dict[str, Any]], bytes]:
    """What each recording is, and their frames one after the other as float32.

    A frame has 7 numbers a link and 3 features (m, degrees, degrees).
    """
    heads, parts = [], []
    for clip in clips:
        every = max(1, round(clip.fps / _FPS))
        qpos = clip.qpos[::every]
        links = link_poses(character, qpos)
        features = clip_features(links[..., :3].astype(np.float64), character) * _DEGREES
        parts.append(np.concatenate([links.reshape(len(qpos), -1), features], axis=1))
        heads.append({"fps": clip.fps / every, "total": len(qpos), "links": links.shape[1]})
    return heads, b"".join(part.astype("<f4").tobytes() for part in parts)
