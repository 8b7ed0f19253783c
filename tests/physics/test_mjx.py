"""MJX against the native engine: the same states, the same targets, Newton on both.

Without contact the two differ by float32 rounding alone. In contact rounding grows as fast as the
physics spreads it, so the tolerances hold for a few control periods from rest.
"""

from __future__ import annotations

import dataclasses
import importlib.util
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from poses import clipped, lying

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.core.types import Kinematics, PhysicsState
from getup_jax.physics import mjx as mjx_module
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.engine import make_engine
from getup_jax.physics.mjx import CPU_COMPILER_OPTIONS, MjxState

CONFIG = PhysicsConfig(engine="mjx", solver="newton", gain_scale=1.5)
NATIVE = dataclasses.replace(CONFIG, engine="native")
STEPS = 30

# The rows of the one batch.
AIRBORNE, STANDING, LYING, SATURATED = range(4)

Step = Callable[[PhysicsState, jax.Array], PhysicsState]


@dataclasses.dataclass(frozen=True)
class Runs:
    """Kinematics [T, B, ...] of both engines from the same start."""

    mjx: Kinematics
    native: Kinematics

    def error(self, field: str, row: int, steps: int) -> float:
        """Largest difference of a field in the first control periods."""
        a, b = (getattr(run, field)[:steps, row] for run in (self.mjx, self.native))
        return float(np.abs(a - b).max())


@pytest.fixture(scope="module")
def newton() -> CharacterSpec:
    return load_character(CONFIG)


@pytest.fixture(scope="module")
def step(newton) -> Step:
    """The only compiled MJX program of these tests, for a batch of four."""
    return jax.jit(make_engine(newton, CONFIG).step, compiler_options=CPU_COMPILER_OPTIONS)


@pytest.fixture(scope="module")
def runs(newton, step) -> Runs:
    """Thirty control periods of the four rows."""
    qpos, qvel, targets = starts(newton)
    native = make_engine(newton, NATIVE)
    return Runs(
        mjx=play(step, placed(qpos, qvel), targets),
        native=play(jax.jit(native.step), native.place(qpos, qvel), targets),
    )


def starts(character: CharacterSpec) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """qpos, qvel and targets [T, B, J]."""
    rng = np.random.default_rng(0)
    qpos, qvel = np.tile(character.neutral_qpos, (4, 1)), np.zeros((4, 55))
    # away from the joint limits, so that the first periods have no constraint at all
    inside = np.clip(
        character.neutral_qpos[7:], character.joint_lower + 0.1, character.joint_upper - 0.1
    )
    qpos[[AIRBORNE, SATURATED], 2] = 2.0
    qpos[[AIRBORNE, SATURATED], 7:] = inside
    qvel[AIRBORNE] = rng.normal(scale=0.5, size=55)
    qpos[LYING] = lying(character, 2)[1]
    qpos[LYING, 2], qpos[LYING, 7:] = 0.12, inside
    for side in ("l", "r"):  # legs up, so that the feet stay off the floor
        qpos[LYING, 7 + character.joint(f"thigh_{side}_flex")] = 0.6
        qpos[LYING, 7 + character.joint(f"shin_{side}_flex")] = -0.3
    targets = np.tile(qpos[:, 7:], (STEPS, 1, 1))
    targets[:, AIRBORNE] += rng.normal(scale=0.05, size=49)
    targets[:, SATURATED] += rng.choice([-3.0, 3.0], size=49)
    arms = [i for i, name in enumerate(character.joint_names) if name.startswith(("arm", "fore"))]
    swing = 0.1 * np.sin(0.2 * np.arange(STEPS))[:, None] * rng.normal(size=len(arms))
    targets[:, STANDING, arms] += swing
    targets[:, STANDING] = clipped(character, targets[:, STANDING])
    return qpos, qvel, targets


def placed(qpos: np.ndarray, qvel: np.ndarray) -> PhysicsState:
    """A state of MJX; a step reads no kinematics, and `place` would be another program."""
    q, v = jnp.asarray(qpos, jnp.float32), jnp.asarray(qvel, jnp.float32)
    return PhysicsState(MjxState(q, v, jnp.zeros_like(v)), kinematics=None)  # type: ignore[arg-type]


def play(step: Step, state: PhysicsState, targets: np.ndarray) -> Kinematics:
    seen = []
    for ctrl in targets:
        state = step(state.replace(kinematics=None), jnp.asarray(ctrl, jnp.float32))
        seen.append(jax.tree.map(np.asarray, state.kinematics))
    return jax.tree.map(lambda *x: np.stack(x), *seen)


FIELDS = (
    ("qpos", 1.0),
    ("link_position", 1.0),
    ("link_quaternion", 1.0),
    ("qvel", 100.0),  # one step turns an error of 1 in rad/s into one of 1/60 rad
    ("link_angular_velocity", 100.0),
    ("link_linear_velocity", 100.0),
)


@pytest.mark.parametrize(("field", "scale"), FIELDS)
@pytest.mark.parametrize(
    ("row", "steps", "atol"),
    [
        # measured errors of qpos: 3e-7, 6e-8, 2e-7 and 1e-6
        (AIRBORNE, 1, 1e-5),
        (STANDING, 5, 1e-5),
        (LYING, STEPS, 1e-5),
        (SATURATED, 1, 1e-5),
    ],
)
def test_mjx_is_native(runs, row, steps, atol, field, scale):
    assert runs.error(field, row, steps) < atol * scale


def test_the_rows_are_what_they_are_meant_to_be(runs, newton):
    native = runs.native
    assert native.link_position[0, AIRBORNE, :, 2].min() > 0.5
    assert np.abs(native.qvel[0, AIRBORNE]).max() > 0.3
    assert native.qpos[-1, STANDING, 2] > 0.9
    assert np.ptp(native.qpos[:, STANDING, 7:], axis=0).max() > 0.05
    # dropped by two centimetres, then at rest on the floor
    assert native.qpos[-1, LYING, 2] < 0.105
    assert np.abs(native.qvel[-1, LYING]).max() < 0.1
    share = np.abs(native.torque[0, SATURATED]) >= newton.torque_limit - 1e-6
    assert share.mean() > 0.9


def test_torques_agree_and_stay_inside_the_limits(runs, newton):
    # the last substep's; a servo of 1000 Nm/rad turns 1e-5 rad into 0.01 Nm
    for row, steps in ((AIRBORNE, 1), (STANDING, 5), (LYING, STEPS), (SATURATED, 1)):
        assert runs.error("torque", row, steps) < 0.05
    assert (np.abs(runs.mjx.torque) <= newton.torque_limit + 1e-3).all()


def test_all_stays_finite(runs):
    assert runs.mjx.finite.all()
    assert runs.native.finite.all()


def test_a_simulation_with_nan_and_targets_that_are_not_finite(newton, step, runs):
    qpos, qvel, targets = starts(newton)
    qpos[STANDING, 9] = np.nan
    targets[:, LYING, 4], targets[:, SATURATED, 4] = np.nan, np.inf
    after = play(step, placed(qpos, qvel), targets[:2])
    np.testing.assert_array_equal(after.finite, [[True, False, True, True]] * 2)
    np.testing.assert_array_equal(after.qpos[:, AIRBORNE], runs.mjx.qpos[:2, AIRBORNE])


def test_the_callers_model_keeps_its_solver(character):
    before = character.model.opt.solver
    make_engine(character, dataclasses.replace(CONFIG, solver="auto"))
    assert character.model.opt.solver == before


@pytest.mark.skipif(importlib.util.find_spec("warp") is not None, reason="warp is installed")
def test_a_missing_extra_says_what_to_install(character):
    with pytest.raises(ConfigError, match=r"physics\.engine: .*pip install 'getup-jax\[warp\]'"):
        make_engine(character, PhysicsConfig(engine="mjx-warp"))


@pytest.mark.parametrize(
    ("backend", "installed", "engine"),
    [("gpu", True, "warp"), ("gpu", False, "jax"), ("tpu", True, "jax")],
)
def test_auto_is_warp_on_a_gpu_that_has_it_else_jax(monkeypatch, backend, installed, engine):
    made = []
    monkeypatch.setattr(jax, "default_backend", lambda: backend)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: installed or None)
    monkeypatch.setattr(mjx_module, "MjxEngine", lambda *_, impl: made.append(impl))
    make_engine(None, PhysicsConfig(engine="auto"))  # type: ignore[arg-type]
    assert made == [engine]


@pytest.mark.slow  # warp compiles its kernels for minutes when it first sees a model
@pytest.mark.skipif(importlib.util.find_spec("warp") is None, reason="needs the extra warp")
def test_warp_does_what_native_does_where_nothing_touches(newton):
    qpos, qvel, targets = starts(newton)
    config = dataclasses.replace(CONFIG, engine="mjx-warp")
    steps = []
    for engine in (make_engine(newton, config), make_engine(newton, NATIVE)):
        steps.append(play(jax.jit(engine.step), engine.place(qpos, qvel), targets[:5]))
    warp = Runs(*steps)
    for field, scale in FIELDS:
        assert warp.error(field, AIRBORNE, 5) < 1e-4 * scale, field


@pytest.mark.slow
def test_place_gives_the_kinematics_of_native(newton):
    qpos, qvel, _ = starts(newton)
    mjx = make_engine(newton, CONFIG).place(qpos, qvel).kinematics
    native = make_engine(newton, NATIVE).place(qpos, qvel).kinematics
    for field, scale in FIELDS:
        error = np.abs(getattr(mjx, field) - getattr(native, field)).max()
        assert error < 1e-5 * scale, field
