"""Goals with balls on the native engine, as an environment runs them."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from getup_jax.config import PhysicsConfig
from getup_jax.envs.composite.goals import equipment_of, make_goals
from getup_jax.envs.composite.goals.drawing import add_markers
from getup_jax.envs.composite.goals.juggling import LEFT, NONE, RIGHT
from getup_jax.physics.character import load_character
from getup_jax.physics.native import NativeEngine

CONFIG = PhysicsConfig(
    engine="native", character="humanoid28", substeps=4, gain_scale=1, armature=0.02, damping=0
)


def simulate(names: tuple[str, ...], steps: int, begin=lambda states: states):
    """Goals by name, and (states, kinematics, outputs) after each step in the neutral pose."""
    character = load_character(CONFIG, equipment=equipment_of(names))
    engine = NativeEngine(character, CONFIG)
    goals = make_goals({name: {} for name in names}, character, engine.control_dt)
    assert character.ball_names == tuple(ball.name for ball in goals.balls)
    physics = engine.place(character.neutral_qpos[None], np.zeros((1, 6 + character.num_joints)))
    ctrl = jnp.asarray(character.neutral_qpos[None, 7:], jnp.float32)

    @jax.jit
    def step(key, states, physics):
        command = goals.command(states, physics.kinematics)
        physics = engine.step(physics, ctrl, command)
        states, outputs = goals.step(key, states, physics.kinematics)
        seen = goals.observe(states, physics.kinematics)
        return states, physics, (states, physics.kinematics, outputs, seen)

    states, trace = begin(jax.jit(goals.reset)(jax.random.key(1), physics.kinematics)), []
    for number in range(steps):
        states, physics, now = step(jax.random.key(number), states, physics)
        trace.append(now)
    return character, goals, trace


def test_juggling_while_walking_to_a_target():
    def begin(states):  # resting hands are at no moment of the interval; the left one is the first
        hands = {"catcher": [[RIGHT, LEFT, LEFT]], "leaving": [[NONE, NONE, RIGHT]], "frame": [0]}
        return states[0], states[1].replace(**{k: jnp.asarray(v) for k, v in hands.items()})

    character, goals, trace = simulate(("target_location", "juggling"), 14, begin)
    hands = character.links(("hand_l", "hand_r"))
    for frame, (states, kinematics, outputs, seen) in enumerate(trace, start=1):
        held = np.asarray(states[1].holder[0])
        ball, hand = np.asarray(kinematics.prop_position)[0], kinematics.link_position[0, hands]
        # the hand moves a little within the step that the ball flies with its old velocity
        assert np.linalg.norm(ball[1] - hand[RIGHT]) < 0.02
        assert held[1] == RIGHT
        assert held[0] == (LEFT if frame < 10 else NONE)
        assert seen.shape == (1, goals.observation_size)
        assert np.isfinite(seen).all()
        assert not outputs[1].terminated[0]
    row = jax.tree.map(lambda x: x[0], (trace[-1][0], trace[-1][1]))
    scene = mujoco.MjvScene(character.model, maxgeom=20)
    markers = goals.markers(*row)
    assert [m.radius for m in markers] == [0.12, 0.12, 0.04, 0.04, 0.04]  # place, hand, balls
    add_markers(scene, markers)
    drawn = [scene.geoms[i].pos for i in range(scene.ngeom)]
    np.testing.assert_allclose(drawn, [m.position for m in markers], atol=1e-6)
    # the third ball, thrown at the start, was nearly at the left hand
    last = trace[-1][1]
    gap = np.asarray(last.prop_position)[0, 2] - last.link_position[0, hands[LEFT]]
    assert np.linalg.norm(gap) < 0.2


def test_a_tennis_ball_flies_to_where_it_should():
    _, goals, trace = simulate(("tennis_swing",), 27)
    (first,), kinematics, _, _ = trace[0]
    end = first.start + first.launch * 0.9 - jnp.asarray([0, 0, 0.5 * 9.81 * 0.9**2])
    ball = np.stack([np.asarray(now[1].prop_position)[0, 0] for now in trace])
    assert np.linalg.norm(ball - np.asarray(end[0]), axis=1).min() < 0.1
    assert np.isfinite(np.stack([now[3] for now in trace])).all()
    tennis = goals.goals[0]
    command = tennis.command(first, kinematics)
    assert command is not None
    assert not command.mask.any()
