from __future__ import annotations

import mujoco
import numpy as np
import pytest

from getup_jax.config import ConfigError
from getup_jax.physics.reroot import rerooted

# A torso with a waist of two hinges away from their bodies' origins, and a turned pelvis below it.
TORSO_FIRST = """
<mujoco>
  <default>
    <default class="stiff"><joint stiffness="3" axis="0 1 0" range="-40 50"/></default>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    <body name="torso" pos="0 0 1.3" quat="0.96 0 0.28 0" childclass="stiff">
      <freejoint name="root"/>
      <geom size="0.1" pos="0 0 0.05"/>
      <body name="waist" pos="-0.01 0 -0.2" quat="0.8 0.6 0 0">
        <joint name="z" axis="0 0 1" pos="0 0 0.06"/>
        <joint name="y" pos="0.02 0 0.06"/>
        <geom size="0.08"/>
        <body name="pelvis" pos="0 0.03 -0.15">
          <joint name="x" axis="1 0 0" pos="0 0 0.1"/>
          <geom size="0.09"/>
          <body name="leg" pos="0 0.1 -0.1"><joint name="hip"/><geom size="0.05"/></body>
        </body>
      </body>
      <body name="arm" pos="0 0.2 0.1"><joint name="shoulder"/><geom size="0.04"/></body>
    </body>
  </worldbody>
  <keyframe><key name="up" qpos="0 0 1 1 0 0 0 0 0 0 0 0"/></keyframe>
</mujoco>
"""


def rehung(root: str) -> tuple[mujoco.MjModel, mujoco.MjModel]:
    spec = mujoco.MjSpec.from_string(TORSO_FIRST)
    return spec.copy().compile(), rerooted(spec, root, "map.yaml").compile()


@pytest.mark.parametrize("root", ["pelvis", "waist", "leg", "torso"])
def test_the_same_angles_put_every_body_in_the_same_place(root):
    before, after = rehung(root)
    assert after.body(1).name == root
    one, other = mujoco.MjData(before), mujoco.MjData(after)
    rng = np.random.default_rng(0)
    for name in ("z", "y", "x", "hip", "shoulder"):
        one.joint(name).qpos[0] = other.joint(name).qpos[0] = rng.normal()
    mujoco.mj_kinematics(before, one)
    other.qpos[:3], other.qpos[3:7] = one.body(root).xpos, one.body(root).xquat
    mujoco.mj_kinematics(after, other)
    for name in ("torso", "waist", "pelvis", "leg", "arm"):
        np.testing.assert_allclose(other.body(name).xpos, one.body(name).xpos, atol=1e-5)
        np.testing.assert_allclose(other.body(name).xmat, one.body(name).xmat, atol=1e-5)


def test_hinges_keep_their_class_and_masses_stay():
    before, after = rehung("pelvis")
    assert after.body_mass.sum() == pytest.approx(before.body_mass.sum())
    np.testing.assert_array_equal(after.jnt_stiffness[1:], 3.0)
    np.testing.assert_allclose(after.joint("x").range, np.radians([-40, 50]), atol=1e-6)
    assert after.nkey == 0  # its columns are in another order
    assert [after.joint(i).name for i in range(1, 6)] == ["hip", "x", "y", "z", "shoulder"]


def test_a_body_that_is_not_there_is_said():
    spec = mujoco.MjSpec.from_string(TORSO_FIRST)
    with pytest.raises(
        ConfigError, match=r"map\.yaml: root: no body 'hips'; the file has torso, w"
    ):
        rerooted(spec, "hips", "map.yaml")
    fixed = mujoco.MjSpec.from_string(
        TORSO_FIRST.replace('<freejoint name="root"/>', "").replace(
            '<keyframe><key name="up" qpos="0 0 1 1 0 0 0 0 0 0 0 0"/></keyframe>', ""
        )
    )
    with pytest.raises(ConfigError, match="body 'torso' has no free joint"):
        rerooted(fixed, "pelvis", "map.yaml")
