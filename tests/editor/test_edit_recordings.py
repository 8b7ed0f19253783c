from __future__ import annotations

import dataclasses
import json
import struct
import types

import numpy as np
import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.editor.answers import answer
from getup_jax.editor.messages import MessageError, Request
from getup_jax.editor.recordings import packed
from getup_jax.editor.simulate import link_poses
from getup_jax.motion.clips import Clip
from getup_jax.motion.retarget.subprocess_job import Stop
from getup_jax.physics.character import load_character

CHARACTER = load_character(PhysicsConfig())


def standing(fps: float, frames: int) -> Clip:
    """A body that stands and moves along x, by a centimetre a frame."""
    qpos = np.tile(CHARACTER.neutral_qpos, (frames, 1))
    qpos[:, 0] = 0.01 * np.arange(frames)
    return Clip("stand", fps, qpos)


def rows(payload: bytes) -> np.ndarray:
    return np.frombuffer(payload, "<f4").reshape(-1, 7 * len(CHARACTER.link_names) + 3)


def test_recordings_follow_each_other_with_links_and_features_at_about_30_frames_a_second():
    heads, payload = packed([standing(30.0, 5), standing(120.0, 9)], CHARACTER)
    links = len(CHARACTER.link_names)
    assert heads == [
        {"fps": 30.0, "total": 5, "links": links},
        {"fps": 30.0, "total": 3, "links": links},
    ]
    found = rows(payload)
    wanted = link_poses(CHARACTER, standing(30.0, 5).qpos).reshape(5, -1)
    np.testing.assert_allclose(found[:5, :-3], wanted, atol=1e-6)
    np.testing.assert_allclose(found[5:, 0], [0.0, 0.04, 0.08], atol=1e-6)
    # upright: the neck is high, and both angles are right ones, in degrees
    assert found[0, -3] > 1.2
    np.testing.assert_allclose(found[:, -2:], 90.0, atol=8.0)


def session(clips: dict[str, Clip]):
    starts = types.SimpleNamespace(clips=clips)
    return types.SimpleNamespace(
        simulator=types.SimpleNamespace(character=CHARACTER, starts=starts)
    )


def test_a_page_is_sent_the_reference_motion_that_it_asks_for():
    request = Request("recording", 3, name="stand")
    found = answer(request, session({"stand": standing(30.0, 4)}), Stop())
    assert isinstance(found, bytes)
    (length,) = struct.unpack_from("<I", found)
    header = json.loads(found[4 : 4 + length])
    assert (header["type"], header["number"]) == ("recording", 3)
    assert header["recordings"][0]["total"] == len(rows(found[4 + length :])) == 4
    with pytest.raises(MessageError, match="expected a reference motion, got 'walk'"):
        answer(dataclasses.replace(request, name="walk"), session({}), Stop())
