"""A USD file has every link where it was, read again with the real library."""

from __future__ import annotations

import sys

import mujoco
import numpy as np
import pytest
from test_glb_writer import random_take

from getup_jax.cli.main import motion_main
from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.motion.io.takes import Take, write_takes
from getup_jax.motion.io.usd_writer import require_usd
from getup_jax.physics.character import load_character

MILLIMETRE = 0.001


@pytest.fixture(scope="module", params=["humanoid49", "humanoid28"])
def character(request):
    return load_character(PhysicsConfig(character=request.param))


@pytest.mark.parametrize("suffix", [".usdc", ".usda"])
def test_links_are_within_a_millimetre(character, tmp_path, suffix):
    usd, geom = pytest.importorskip("pxr.Usd"), pytest.importorskip("pxr.UsdGeom")
    take, path = random_take(character), tmp_path / f"takes{suffix}"
    write_takes(path, character, [take, Take("2nd, still", 50.0, character.neutral_qpos[None])])
    stage = usd.Stage.Open(str(path))
    assert geom.GetStageUpAxis(stage) == geom.Tokens.z
    assert geom.GetStageMetersPerUnit(stage) == 1.0
    assert (stage.GetTimeCodesPerSecond(), stage.GetEndTimeCode()) == (25.0, 29.0)
    ranges = stage.GetRootLayer().customLayerData["takes"]
    assert dict(ranges) == {"wild": "0-4: wild", "_2nd__still": "29-29: 2nd, still"}
    nodes = {prim.GetName(): prim for prim in stage.Traverse() if prim.IsA(geom.Xform)}
    data = mujoco.MjData(character.model)
    for time, qpos in [*enumerate(take.qpos), (29, character.neutral_qpos)]:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(character.model, data)
        cache = geom.XformCache(time)
        for link, name in enumerate(character.link_names):
            world = np.array(cache.GetLocalToWorldTransform(nodes[name]))
            assert np.abs(world[3, :3] - data.xpos[1 + link]).max() < MILLIMETRE
            # USD multiplies rows
            assert np.abs(world[:3, :3].T.ravel() - data.xmat[1 + link]).max() < 1e-3


def test_meshes_fill_the_standing_character(character, tmp_path):
    usd, geom = pytest.importorskip("pxr.Usd"), pytest.importorskip("pxr.UsdGeom")
    write_takes(tmp_path / "still.usd", character, [])
    stage = usd.Stage.Open(str(tmp_path / "still.usd"))
    box = geom.BBoxCache(usd.TimeCode.Default(), [geom.Tokens.default_])
    bounds = box.ComputeWorldBound(stage.GetDefaultPrim()).ComputeAlignedRange()
    assert bounds.GetMin()[2] == pytest.approx(0.0, abs=0.02)
    assert 1.5 < bounds.GetMax()[2] < 1.9


def test_the_command_writes_a_source_as_usd(tmp_path, capsys):
    usd = pytest.importorskip("pxr.Usd")
    path = tmp_path / "two.usd"
    names = ["prone_plank_walk", "supine_situp_squat"]
    assert motion_main(["usd", "authored", "--out", str(path), "--curves", *names]) == 0
    assert f"{path}: 2 motions" in capsys.readouterr().out
    stage = usd.Stage.Open(str(path))
    assert sorted(stage.GetRootLayer().customLayerData["takes"]) == names


def test_without_the_library_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ConfigError, match=r"--usd: needs pxr; .*getup-jax\[usd\]"):
        require_usd()
