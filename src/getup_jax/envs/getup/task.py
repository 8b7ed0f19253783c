"""The get-up task [P 3 to 5]: follow three style curves from the floor to standing."""

from __future__ import annotations

import dataclasses
import math

import jax
import jax.numpy as jnp

from getup_jax.config import TaskConfig, TerrainConfig
from getup_jax.core import device_axis
from getup_jax.core.masked_update import replace_rows
from getup_jax.core.mirror import Symmetry
from getup_jax.core.quaternion import angle, conjugate, multiply
from getup_jax.core.types import Engine, StepOutput, take
from getup_jax.envs.getup import rewards, terminations, user_rewards
from getup_jax.envs.getup.action_decoder import ActionDecoder
from getup_jax.envs.getup.curriculum import regions
from getup_jax.envs.getup.curriculum.curriculum import Curriculum, Draw
from getup_jax.envs.getup.curriculum.state import CurriculumState
from getup_jax.envs.getup.drawn_curves import Curve, style_curve
from getup_jax.envs.getup.episode import EpisodeState, Record, full_steps, recorded, verdict
from getup_jax.envs.getup.observation import Observer, Posture
from getup_jax.envs.getup.user_rewards import RewardInputs
from getup_jax.envs.getup.world import World
from getup_jax.motion.getup import curves
from getup_jax.physics.character import CharacterSpec

__all__ = ["GetUpTask", "World"]

_RESET_CHUNK = 32  # episodes that start anew at once; a step rarely ends more of some hundred


@dataclasses.dataclass(frozen=True, eq=False)
class GetUpTask:
    """The `Environment` of the get-up task: `advance` is one step, `step` also resets."""

    engine: Engine
    character: CharacterSpec
    observer: Observer
    config: TaskConfig
    curriculum: Curriculum
    latent_size: int  # 0 without a pose prior
    symmetry: Symmetry | None = None  # of observations and actions; None: there is none

    @property
    def terrain(self) -> TerrainConfig | None:
        """Irregular ground; None: a flat plane."""
        return self.curriculum.terrain

    def with_terrain(self, terrain: TerrainConfig) -> GetUpTask:
        """The same task on the same ground, whose regions open otherwise."""
        curriculum = dataclasses.replace(self.curriculum, terrain=terrain)
        return dataclasses.replace(self, curriculum=curriculum)

    @property
    def observation_size(self) -> int:
        """O."""
        return self.observer.size

    @property
    def num_objectives(self) -> int:
        """K: one for each of `objective_weights`."""
        return len(self.objective_weights)

    @property
    def objective_weights(self) -> dict[str, float]:
        """Objectives and their weights: all terms multiplied, or each of them, and tracking."""
        config = self.curriculum.config
        names = ("total",) if config.objectives == "product" else self._term_names
        track = {"track": config.track_weight} if config.track_weight > 0 else {}
        return dict.fromkeys(names, 1.0) | track

    def discounts(self, usual: float) -> tuple[float, ...] | None:
        """Those of the objectives [K]: the usual one, but for tracking; None: all have that."""
        of_tracking = self.curriculum.config.track_discount
        if of_tracking is None or "track" not in self.objective_weights:
            return None
        return (usual,) * (self.num_objectives - 1) + (of_tracking,)

    @property
    def _term_names(self) -> tuple[str, ...]:
        """Without a pose prior there is nothing that offsets could be unnatural to [P 6.4]."""
        own = rewards.TERMS if self.latent_size == 0 else (*rewards.TERMS, "natural")
        return (*own, *self.config.rewards)

    @property
    def action_size(self) -> int:
        """A: the latent pose and one offset a hinge."""
        return self.latent_size + self.character.num_joints

    def init(self, world: World, key: jax.Array, num_envs: int) -> EpisodeState:
        """B fresh episodes."""
        key_start, key_state = jax.random.split(key)
        learned = self.curriculum.first(world.pool)
        drawn = self.curriculum.draw(world, learned, key_start, num_envs)
        drawn = self.curriculum.with_curves(world, key_start, drawn)
        return self._begin(world, drawn, learned).replace(key=key_state, curriculum=learned)

    def stagger(self, state: EpisodeState, key: jax.Array) -> EpisodeState:
        """Episodes [B] that are cut at any time; what comes after them runs to its end."""
        left = state.duration + self.config.stand_time_s - state.time
        share = jax.random.uniform(key, left.shape)
        cut = state.time + share * left
        return state.replace(until=cut if state.until is None else jnp.minimum(state.until, cut))

    def step(
        self, world: World, state: EpisodeState, action: jax.Array
    ) -> tuple[EpisodeState, StepOutput]:
        """One control step; episodes that end start anew."""
        after, output = self.advance(world, state, action)
        key_next, key_reset = jax.random.split(state.key)
        key_reset = device_axis.own_key(key_reset)
        before = state.curriculum or CurriculumState()
        learned, output = self.curriculum.update(world.pool, before, after, output)
        drawn = self.curriculum.draw(world, learned, key_reset, action.shape[0])

        def fresh(index: jax.Array) -> EpisodeState:
            picked = jax.tree.map(lambda x: x[index], drawn)
            picked = self.curriculum.with_curves(world, key_reset, picked, index[0])
            begun = self._begin(world, picked, learned).replace(key=None)
            if state.until is None or begun.until is not None:
                return begun  # episodes are cut short, or none is
            return begun.replace(until=jnp.full_like(begun.time, jnp.inf))  # only first ones are

        done = output.done
        # what belongs to the whole batch has no simulation axis and stays out of the rows
        after = replace_rows(after.replace(key=None, curriculum=None), done, fresh, _RESET_CHUNK)
        after = after.replace(key=key_next, curriculum=learned)
        return after, output.replace(observation=after.observation)

    def _begin(self, world: World, drawn: Draw, learned: CurriculumState) -> EpisodeState:
        state = self.start(
            world, drawn.getup, drawn.kind, drawn.row, curve=drawn.curve, region=drawn.region
        )
        return self.curriculum.prepared(world.pool, learned, drawn, state)

    def start(
        self,
        world: World,
        getup: jax.Array,
        kind: jax.Array,
        row: jax.Array,
        curve: Curve | None = None,
        region: jax.Array | None = None,
    ) -> EpisodeState:
        """Episodes of the given styles [B], kinds of start [B] and rows [B] of the pool.

        curve: what they follow, with starts along it at the same phase; None: that of their style.
        region [B]: where on irregular ground; None is the first one, as on a flat plane.
        """
        index = world.pool.table[kind, 0 if region is None else region, getup, row]
        physics = take(world.pool.physics, index)
        size = len(getup)
        own = style_curve(world, getup)
        curve = own if curve is None else curve
        posture = self.observer.posture(physics.kinematics, world.terrain)
        state = EpisodeState(
            physics=physics,
            observation=jnp.zeros((size, self.observation_size), jnp.float32),
            action=jnp.zeros((size, self.action_size), jnp.float32),
            getup=getup,
            kind=kind,
            time=world.pool.time[index] * (curve.duration / own.duration),
            points=curve.from_pose(posture.features),
            duration=curve.duration,
            low_steps=jnp.zeros(size, jnp.int32),
            head_steps=jnp.zeros(size, jnp.int32),
            record=Record.empty(size),
            key=jnp.zeros(2, jnp.uint32),
            region=self._region_of(region, getup),
        )
        # The filter keeps most of the last action, so the first target must be the start pose.
        angles, condition = physics.kinematics.qpos[:, 7:], self.targets(state)[:, 0]
        given = None if world.pool.action is None else world.pool.action[index]
        action, unasked = self.decoder(world).begin(angles, condition, given)
        state = state.replace(action=action, start_offset=unasked)
        return state.replace(observation=self._observe(state, posture))

    def advance(
        self, world: World, state: EpisodeState, action: jax.Array
    ) -> tuple[EpisodeState, StepOutput]:
        """One control step without resets; `observation` is the final one."""
        filtered = self.config.filter * action + (1.0 - self.config.filter) * state.action
        target = self.servo_target(world, state, filtered)
        wrench = self.curriculum.wrench(world.terrain, self.observer, state, self.targets(state))
        physics = self.engine.step(state.physics, target, wrench=wrench)
        state = state.replace(
            physics=physics, action=filtered, time=state.time + self.engine.control_dt
        )
        if state.start_offset is not None:
            left = (1.0 - self.config.filter) * state.start_offset
            state = state.replace(start_offset=left)
        posture = self._posture(world, state)
        target = self.targets(state)[:, 0]
        terms = self._reward_terms(world, state, posture, target)
        if self.config.rewards:
            own = self._user_terms(world, state, posture, target)
            terms |= own | {"total": math.prod(own.values(), start=terms["total"])}
        finite = physics.kinematics.finite & jnp.isfinite(filtered).all(axis=-1)  # it would stay
        terms = {name: jnp.where(finite, value, 0.0) for name, value in terms.items()}
        gap = terminations.head_gap(self.character, world.terrain, physics.kinematics)
        head, control_dt = gap < self.config.head_clearance_m, self.engine.control_dt
        grace_s = self.curriculum.config.head_grace_s
        state, causes = terminations.counted(
            self.config, control_dt, state, terms["task"], head, grace_s
        )
        causes["not_finite"] = ~finite
        for name in self.objective_weights:
            terms[name] = terminations.paid(self.config, control_dt, state, terms[name], grace_s)
        terminated = causes["low_reward"] | causes["head"] | causes["not_finite"]
        half_step = 0.5 * control_dt
        end = state.duration + self.config.stand_time_s - half_step
        if state.until is not None:
            end = jnp.minimum(end, state.until - half_step)
        truncated = ~terminated & (state.time > end)
        stand_s, value = self.config.stand_time_s, posture.features
        state = recorded(state, value, target, terms["task"], stand_s)
        observation = jnp.where(finite[:, None], self._observe(state, posture), 0.0)
        state = state.replace(observation=observation)
        output = StepOutput(
            observation=observation,
            final_observation=observation,
            reward=jnp.stack([terms[name] for name in self.objective_weights], axis=-1),
            terminated=terminated,
            truncated=truncated,
            terms=terms,
            ended=causes,
            episode=self._verdict(state, truncated),
        )
        return state, output

    def _verdict(self, state: EpisodeState, truncated: jax.Array) -> dict[str, jax.Array]:
        full = full_steps(state, self.config.stand_time_s, self.engine.control_dt)
        episode = verdict(state, truncated, full)
        if state.region is None:
            return episode
        return episode | regions.by_region(episode, state.region)

    def servo_target(self, world: World, state: EpisodeState, filtered: jax.Array) -> jax.Array:
        """Hinge targets [B, J]: q = decoder(z, c) + dq [P 3.4], c the curve values now."""
        target = self.decoder(world).target(filtered, self.targets(state)[:, 0])
        return jnp.clip(target, world.target_lower, world.target_upper)

    def decoder(self, world: World) -> ActionDecoder:
        """What the actions mean."""
        neutral = jnp.asarray(self.character.neutral_qpos[7:], jnp.float32)
        return ActionDecoder(world.prior, self.config.offset_scale, neutral)

    def _region_of(self, region: jax.Array | None, getup: jax.Array) -> jax.Array | None:
        """The state's region [B]: None on a flat plane, the first one where none is given."""
        if self.terrain is None:
            return None
        return jnp.zeros_like(getup) if region is None else region

    def targets(self, state: EpisodeState) -> jax.Array:
        """Curve values [B, n, 3] at the look-ahead times; the first one is now."""
        ahead = jnp.asarray(self.config.lookahead_s, jnp.float32)
        s = (state.time[:, None] + ahead) / state.duration[:, None]
        return curves.evaluate(state.points[:, None], s)

    def _posture(self, world: World, state: EpisodeState) -> Posture:
        return self.observer.posture(state.physics.kinematics, world.terrain)

    def _observe(self, state: EpisodeState, posture: Posture) -> jax.Array:
        return self.observer.observe(posture, self.targets(state), state.action)

    def _reward_terms(
        self, world: World, state: EpisodeState, posture: Posture, target: jax.Array
    ) -> dict[str, jax.Array]:
        config, curriculum = self.config, self.curriculum.config
        omega = posture.link_angular_velocity.reshape(len(target), -1)
        joint_error = angle(multiply(conjugate(world.neutral_rotation), posture.joint_rotation))
        end = state.points[:, -1, 0]
        terms = rewards.terms(posture.features, target, end, omega, joint_error)
        terms["total"] = rewards.sharpened(terms, curriculum.reward_sharpness)
        if curriculum.track_weight > 0:
            sharpness, of_height = curriculum.track_sharpness, curriculum.track_height_sharpness
            terms["track"] = rewards.tracking(terms, sharpness, of_height)
        if world.prior is None:  # nothing that offsets could be unnatural to [P 6.4]
            return terms
        asked = self.decoder(world).asked(state.action, state.start_offset)
        terms["natural"] = rewards.natural(asked, config.offset_limit_rad)
        terms["total"] = terms["total"] * terms["natural"]
        return terms

    def _user_terms(
        self, world: World, state: EpisodeState, posture: Posture, target: jax.Array
    ) -> dict[str, jax.Array]:
        """Those of `task.rewards`, which are factors of the total."""
        inputs = RewardInputs(
            kinematics=state.physics.kinematics,
            posture=posture,
            target=target,
            phase=state.time / state.duration,
            offset=self.decoder(world).offset(state.action),
        )
        return user_rewards.terms(self.config.rewards, inputs)
