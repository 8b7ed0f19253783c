from __future__ import annotations

import dataclasses
import json
import shutil
import struct
import subprocess
import types

import numpy as np
import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.editor.answers import answer
from getup_jax.editor.messages import MessageError, Request
from getup_jax.editor.recordings import packed
from getup_jax.editor.simulate import link_poses
from getup_jax.editor.site import PAGE
from getup_jax.motion.clips import Clip
from getup_jax.motion.retarget.subprocess_job import Stop
from getup_jax.physics.character import load_character
from getup_jax.physics.mirror_image import link_images

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


NODE = shutil.which("node")
MIRROR = """
import { mirrored } from "%s";
const { frames, ...recording } = JSON.parse(process.argv[1]), link = JSON.parse(process.argv[2]);
const image = mirrored({ ...recording, frames: Float32Array.from(frames) }, link);
console.log(JSON.stringify([...image.frames]));
"""


@pytest.mark.skipif(NODE is None, reason="needs node to run the page's module")
def test_the_mirror_image_that_the_page_makes_is_that_of_the_character():
    random = np.random.default_rng(0)
    turn = random.normal(size=(3, 4))
    root = np.c_[random.normal(size=(3, 3)), turn / np.linalg.norm(turn, axis=1)[:, None]]
    clip = Clip("any", 30.0, np.c_[root, random.uniform(-1, 1, (3, CHARACTER.num_joints))])
    image = dataclasses.replace(clip, qpos=CHARACTER.mirror(clip.qpos))
    heads, payload = packed([clip, image], CHARACTER)
    found, wanted = np.split(rows(payload), 2)
    head = json.dumps({**heads[0], "frames": found.ravel().tolist()})
    links = json.dumps(link_images(CHARACTER).tolist())
    script = MIRROR % (PAGE / "motion_recording.js").as_uri()
    command = [NODE, "--input-type=module", "-e", script, head, links]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    made = np.array(json.loads(done.stdout)).reshape(wanted.shape)
    np.testing.assert_allclose(made[:, -3:], wanted[:, -3:], atol=1e-3)  # m, degrees
    made, wanted = (x[:, :-3].reshape(3, -1, 7) for x in (made, wanted))
    np.testing.assert_allclose(made[..., :3], wanted[..., :3], atol=1e-5)
    same_turn = np.abs((made[..., 3:] * wanted[..., 3:]).sum(axis=-1))
    np.testing.assert_allclose(same_turn, 1.0, atol=1e-5)
