from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest
from edit_samples import SECONDS, make_curve, make_ground_simulator, whole_motion
from ground_samples import TERRAIN
from tiny_task import getups, neutral_prior

from eval_samples import make_policy
from getup_jax.core.types import take
from getup_jax.editor.scene import ground
from getup_jax.editor.simulate import Frames, Motion
from getup_jax.editor.starts import Place, lies, reference_curve
from getup_jax.envs.getup.build import assemble
from getup_jax.envs.getup.resets import region_pool
from getup_jax.evaluation.metrics import episode_values
from getup_jax.evaluation.rollout import CHUNK, run_episodes
from getup_jax.evaluation.scenario import Scenario, drawn, make_plan
from getup_jax.motion.clips import MotionError
from getup_jax.physics.character import load_character


def test_frames_come_in_chunks_and_then_the_whole_motion(simulator):
    *parts, motion = simulator.run(make_curve())
    assert all(isinstance(part, Frames) for part in parts)
    assert isinstance(motion, Motion)
    assert [part.first for part in parts] == list(range(0, simulator.steps(make_curve()), CHUNK))
    total = round((SECONDS + simulator.config.task.stand_time_s) / simulator.control_dt)
    assert len(motion.frames.qpos) == len(motion.time) == total == simulator.steps(make_curve())
    np.testing.assert_array_equal(
        motion.frames.links, np.concatenate([part.links for part in parts])
    )
    np.testing.assert_allclose(motion.time[0], simulator.control_dt, rtol=1e-6)
    np.testing.assert_allclose(motion.target[-1], make_curve().getups()[0].points[-1], rtol=1e-5)


def test_it_is_what_an_evaluation_of_the_curve_file_does_to_the_last_bit(simulator):
    curve, config = make_curve(1.2), simulator.config
    character = load_character(config.physics)
    styles = drawn([curve], getups(character), character)
    task = assemble(config, character, styles, neutral_prior(character), lambda text: None)
    learner, policy = make_policy(task, config)
    *_, rows = task.world.pool.table.shape
    plan = make_plan(Scenario(), 1, len(styles), rows)
    trace = run_episodes(task, learner, policy, plan, lambda done: None).trace
    motion, steps = whole_motion(simulator, curve), int(trace.running.sum())
    assert steps == motion.frames.running.sum() >= CHUNK - 1
    np.testing.assert_array_equal(motion.frames.qpos[:steps], trace.qpos[:steps, 0])
    np.testing.assert_array_equal(motion.target[:steps], trace.target[:steps, 0])
    values = episode_values(trace, simulator.control_dt, config.task.stand_time_s)
    for name in ("success", "height_error_m", "angle_error_rad", "energy_j", "jitter"):
        assert motion.scores[name] == pytest.approx(float(values[name][0]), rel=1e-6), name


def test_an_edit_changes_the_target_and_nothing_is_compiled_again(simulator):
    first = whole_motion(simulator, make_curve(1.4))
    compiled = simulator.advance._cache_size()
    second = whole_motion(simulator, make_curve(0.4))
    longer = whole_motion(simulator, dataclasses.replace(make_curve(), durations=(2.0,)))
    assert second.target[-1, 0] == pytest.approx(0.4)
    assert first.target[-1, 0] == pytest.approx(1.4)
    assert len(longer.time) > len(first.time)
    assert simulator.advance._cache_size() == compiled


def test_starts_may_be_mirrored_and_the_gap_to_the_curve_is_known(simulator):
    plain = whole_motion(simulator, make_curve())
    other = whole_motion(simulator, make_curve(start="mirrored clip"))
    assert plain.start_gap_rad < 0.1
    assert other.frames.qpos.shape == plain.frames.qpos.shape
    front = np.array([0.0, 0.0, 60.0])
    turned = dataclasses.replace(make_curve(), values=make_curve().values + front)
    assert simulator.starts.gap(turned) == pytest.approx(np.radians(60), abs=0.1)
    with pytest.raises(MotionError, match="start: expected one of clip, got 'nothing'"):
        whole_motion(simulator, make_curve(start="nothing"))


def test_a_reference_motion_is_described_as_a_person_would_write_it(simulator):
    (style,) = simulator.task.getups
    curve = reference_curve(style)
    assert (curve.name, curve.start, curve.durations) == ("clip", "clip", (1.0,))
    np.testing.assert_allclose(curve.getups()[0].points, style.points, atol=0.002)
    assert lies(style.clip, simulator.character) == "supine"


@pytest.mark.slow
def test_on_irregular_ground_the_place_chooses_the_start(tiny, tmp_path, monkeypatch):
    monkeypatch.setattr(region_pool, "cache_dir", lambda: tmp_path)
    simulator = make_ground_simulator(tiny[1], TERRAIN)
    starts, curve = simulator.starts, make_curve()
    assert starts.places == 2
    pool = simulator.task.world.pool
    for region, number in ((0, 1), (1, 0), (3, 1)):
        found = starts.pool(curve, Place(region, number))
        row = found.table[0, region, 0, 0]
        expected = take(pool.physics, pool.table[0, region, 0, number])
        got = take(found.physics, row)
        np.testing.assert_array_equal(got.kinematics.qpos, expected.kinematics.qpos)
    with pytest.raises(MotionError, match="on irregular ground expected one of clip"):
        starts.pool(make_curve(start="mirrored clip"), Place())
    motion = whole_motion(simulator, curve, Place(3, 1))
    around = ground(simulator, motion.frames.links[0, 0, :2])
    assert around is not None
    assert np.ptp(around["heights"]) > 0.05
    assert len(around["heights"]) == around["points"] ** 2
    below = motion.frames.links[0, 0, :2] + np.random.default_rng(0).uniform(-5, 5, (200, 2))
    drawn = [drawn_height(around, *xy) for xy in below]
    np.testing.assert_allclose(drawn, ray_heights(simulator.character.model, below), atol=0.001)


def drawn_height(ground, x: float, y: float) -> float:
    """Height (m) of the triangles that page/ground.js makes of the message."""
    column, u = divmod((x - ground["origin"][0]) / ground["step"], 1.0)
    row, v = divmod((y - ground["origin"][1]) / ground["step"], 1.0)
    heights = np.reshape(ground["heights"], (ground["points"], ground["points"]))
    (low, right), (up, far) = heights[int(row) : int(row) + 2, int(column) : int(column) + 2]
    if v <= u:
        return low + u * (right - low) + v * (far - right)
    return low + v * (up - low) + u * (far - up)


def ray_heights(model: mujoco.MjModel, places: np.ndarray) -> np.ndarray:
    """Height (m) of MuJoCo's ground below places [N, 2], by rays from above."""
    data = mujoco.MjData(model)
    data.qpos[2] = 100.0  # the body is out of the way
    mujoco.mj_forward(model, data)
    down, hit = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
    starts = [np.array([*xy, 20.0]) for xy in places]
    rays = [mujoco.mj_ray(model, data, start, down, None, 1, -1, hit) for start in starts]
    return 20.0 - np.array(rays)
