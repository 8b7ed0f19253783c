"""Messages of a page that steers."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from getup_jax.config import ConfigError
from getup_jax.editor.messages import MessageError
from getup_jax.editor.steer.character import Frame
from getup_jax.editor.steer.messages import Request, frame_message, read


def test_requests_are_read():
    assert read('{"type": "begin", "number": 1}') == Request("begin")
    assert read('{"type": "shown", "frame": 7}').number == 7
    assert read('{"type": "policy", "name": "walk"}').name == "walk"
    assert read('{"type": "push", "yaw_deg": -90}').yaw_deg == -90.0
    order = {"type": "order", "goal": "target_location", "order": {"place": [1, 2.5]}}
    assert read(json.dumps(order)).order == {"place": (1.0, 2.5), "within_s": 4.0}


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (b"{}", "expected text of at most 4000 letters"),
        ('"' + "x" * 4000 + '"', "expected text of at most 4000 letters"),
        ("[" * 3000, "expected JSON"),
        ("", "expected JSON"),
        ("[]", "expected a type of begin, shown"),
        ('{"type": ["begin"]}', "expected a type of begin, shown"),
        ('{"type": "simulate"}', "expected a type of begin, shown"),
        ('{"type": "shown", "frame": 1.5}', "frame: expected the number of a frame"),
        ('{"type": "shown", "frame": true}', "frame: expected the number of a frame"),
        ('{"type": "policy"}', "name: expected a name"),
        ('{"type": "order", "goal": "fly"}', "goal: expected one of target_heading"),
        ('{"type": "order", "goal": "aiming"}', "aiming: expected {yaw_deg, pitch_deg}"),
        ('{"type": "order", "goal": "juggling", "order": {}}', "juggling: cannot be steered"),
        ('{"type": "order", "goal": "aiming", "order": {"yaw": 1}}', "aiming: unknown 'yaw'"),
        (
            '{"type": "order", "goal": "target_location", "order": {"place": [NaN, 0]}}',
            "target_location.place: expected",
        ),
        (
            '{"type": "order", "goal": "target_location", "order": {"place": [1e99, 0]}}',
            "target_location.place: expected",
        ),
        ('{"type": "push", "yaw_deg": NaN}', "yaw_deg: expected degrees"),
        ('{"type": "push", "yaw_deg": "north"}', "yaw_deg: expected degrees"),
    ],
)
def test_what_is_wrong_with_a_message_is_said(message, text):
    with pytest.raises((MessageError, ConfigError)) as caught:
        read(message)
    assert text in str(caught.value)


def test_a_frame_carries_its_poses_and_what_is_said():
    links = np.arange(14, dtype=np.float32).reshape(2, 7)
    message = frame_message(9, Frame(links, {"phase": "acts"}))
    (length,) = struct.unpack_from("<I", message)
    assert json.loads(message[4 : 4 + length]) == {"type": "frame", "number": 9, "phase": "acts"}
    np.testing.assert_array_equal(np.frombuffer(message[4 + length :], "<f4"), links.ravel())
