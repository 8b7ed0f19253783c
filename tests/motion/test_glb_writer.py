"""A GLB file has every link where it was, read again with the real libraries."""

from __future__ import annotations

import io
import sys

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from getup_jax.cli.main import motion_main
from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.motion.io.glb_writer import Take, glb_bytes, write_glb
from getup_jax.physics.character import load_character

gltf = pytest.importorskip("pygltflib")
MILLIMETRE = 0.001
KINDS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


@pytest.fixture(scope="module", params=["humanoid49", "humanoid28"])
def character(request):
    return load_character(PhysicsConfig(character=request.param))


def random_take(character, frames: int = 5) -> Take:
    rng = np.random.default_rng(0)
    qpos = rng.normal(size=(frames, 7 + character.num_joints))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    return Take("wild", 25.0, qpos)


def rows(document, number: int) -> np.ndarray:
    """What an accessor means."""
    accessor = document.accessors[number]
    view = document.bufferViews[accessor.bufferView]
    blob = document.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    kind = {5126: np.float32, 5125: np.uint32}[accessor.componentType]
    return np.frombuffer(blob, kind).reshape(accessor.count, KINDS[accessor.type])


def places(document, animation, frame: int) -> dict[str, np.ndarray]:
    """World positions of all nodes in a frame of an animation, as a viewer computes them."""
    moved: dict[tuple[int, str], np.ndarray] = {}
    for channel in animation.channels:
        values = rows(document, animation.samplers[channel.sampler].output)
        moved[channel.target.node, channel.target.path] = values[frame]
    found = {}

    def walk(number: int, position: np.ndarray, turn: Rotation) -> None:
        node = document.nodes[number]
        place = moved.get((number, "translation"), node.translation or [0, 0, 0])
        own = moved.get((number, "rotation"), node.rotation or [0, 0, 0, 1])
        position = position + turn.apply(np.asarray(place, float))
        turn = turn * Rotation.from_quat(own)
        found[node.name] = position
        for child in node.children or []:
            walk(child, position, turn)

    for number in document.scenes[document.scene].nodes:
        walk(number, np.zeros(3), Rotation.identity())
    return found


def test_links_are_within_a_millimetre(character, tmp_path):
    take, path = random_take(character), tmp_path / "take.glb"
    write_glb(path, character, [take, Take("still", 30.0, character.neutral_qpos[None])])
    document = gltf.GLTF2().load(str(path))
    assert [a.name for a in document.animations] == ["wild", "still"]
    time = rows(document, document.animations[0].samplers[0].input)
    np.testing.assert_allclose(time[:, 0], np.arange(5) / 25.0, atol=1e-6)
    data = mujoco.MjData(character.model)
    for frame, qpos in enumerate(take.qpos):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(character.model, data)
        found = places(document, document.animations[0], frame)
        for link, name in enumerate(character.link_names):
            x, y, z = data.xpos[1 + link]  # Y is up in the file
            assert np.abs(found[name] - [x, z, -y]).max() < MILLIMETRE


def test_meshes_fill_the_standing_character(character):
    import trimesh

    scene = trimesh.load(io.BytesIO(glb_bytes(character, [])), file_type="glb")
    low, high = scene.bounds
    assert low[1] == pytest.approx(0.0, abs=0.02)  # the soles, Y up
    assert 1.5 < high[1] < 1.9
    shapes = sum(1 for body in character.model.geom_bodyid if body > 0)
    assert 0.5 * shapes < len(scene.geometry) <= shapes
    for mesh in scene.geometry.values():
        centre = mesh.vertices.mean(axis=0)
        outward = np.einsum("ni,ni->n", mesh.vertex_normals, mesh.vertices - centre)
        assert (outward > 0).all()


def test_rotations_take_the_short_way(character):
    turns = np.tile(character.neutral_qpos, (2, 1))
    turns[0, 3:7], turns[1, 3:7] = [1, 0, 0, 0], [-0.9999, 0.01, 0, 0]
    document = gltf.GLTF2.load_from_bytes(glb_bytes(character, [Take("flip", 30.0, turns)]))
    rotation = rows(document, document.animations[0].samplers[1].output)
    assert (rotation[0] * rotation[1]).sum() > 0.99


def test_the_command_writes_authored_motions(tmp_path, capsys):
    path = tmp_path / "all.glb"
    name = "prone_half_kneel_left"
    assert motion_main(["glb", "authored", "--curves", name, "--out", str(path)]) == 0
    assert "1 motions" in capsys.readouterr().out
    (animation,) = gltf.GLTF2().load(str(path)).animations
    assert name in animation.name
    with pytest.raises(SystemExit):
        motion_main(["glb", "authored", "--out", str(tmp_path / "all.bvh")])


def test_a_missing_library_is_one_line(character, monkeypatch):
    monkeypatch.setitem(sys.modules, "pygltflib", None)
    with pytest.raises(ConfigError, match=r"pip install 'getup-jax\[glb\]'"):
        glb_bytes(character, [])
