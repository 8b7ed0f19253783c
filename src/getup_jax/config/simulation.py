"""The simulated body, the ground under it, the motions and the pose prior made of them."""

from __future__ import annotations

import dataclasses
import math

from getup_jax.config.check import require
from getup_jax.config.ranges import LAST_SEED, MOST_COUNT, check_numbers, number

_LEAST_OWN_M = 8.0  # side of a ground of one's own: its starts are 3 m from the edge


@dataclasses.dataclass(frozen=True)
class PhysicsConfig:
    """The simulator: engine, rate and servo."""

    engine: str = "auto"  # auto | native | mjx | mjx-warp; auto: the fastest here
    character: str = "humanoid49"  # assets/NAME.xml, or a path to an MJCF file
    control_hz: int = number(30, least=1, most=1000)  # policy rate
    substeps: int = number(2, least=1, most=1000)  # physics steps in one control period
    solver: str = "auto"  # newton | cg | pgs; auto: pgs on native, newton on MJX, which has no pgs
    iterations: int = number(10, least=1, most=1000)  # solver iterations at most
    # times the stiffness and damping of the MJCF file
    gain_scale: float = number(1.5, above=0, most=100)
    # times the torque limits of the MJCF file
    torque_scale: float = number(1.0, above=0, most=1000)
    armature: float = number(0.1, least=0, most=100)  # kg m^2, added to every hinge
    # Nms/rad of every hinge; all that a servo at its torque limit has
    damping: float = number(1.0, least=0, most=1000)
    # native: worker threads; 0: every CPU this process may use
    threads: int = number(0, least=0, most=1024)

    def __post_init__(self) -> None:
        check_numbers(self, "physics")
        engines = ("auto", "native", "mjx", "mjx-warp")
        require(self.engine in engines, "physics.engine", f"one of {engines}", self.engine)
        solvers = ("auto", "newton", "cg", "pgs")
        require(self.solver in solvers, "physics.solver", f"one of {solvers}", self.solver)
        mjx_pgs = self.engine.startswith("mjx") and self.solver == "pgs"
        expected = "auto, newton or cg, since MJX has no PGS"
        require(not mjx_pgs, "physics.solver", expected, self.solver)


@dataclasses.dataclass(frozen=True)
class TerrainConfig:
    """Irregular ground in four regions: flat, easy, medium and hard [P 3.2, 5.4].

    Half of each irregular region is rough, and half has even slopes in all directions. Or they are
    a third, two thirds and all of the heights in a file.
    """

    # PNG, .npy or MuJoCo height field of one's own ground, region_size_m on a side
    heights: str | None = None
    # from its lowest to its highest place; null: an .npy file is in metres
    height_m: float | None = number(None, above=0, most=100)

    # another seed is another ground of the same kind
    seed: int = number(0, least=0, most=LAST_SEED)
    region_size_m: float = number(48.0, above=0, most=500)  # side of a region, a square
    border_m: float = number(4.0, least=2, most=100)  # flat ground around the regions
    # between two heights of the field; collisions with a finer one are slow
    grid_step_m: float = number(0.5, least=0.5, most=10)
    tile_m: float = number(1.0, above=0, most=100)  # side of a tile of the rough ground
    # its corners move up or down by at most this
    rough_m: tuple[float, ...] = number((0.06, 0.13, 0.2), least=0, most=2, length=3)
    # steepest slope of easy, medium, hard
    slope_deg: tuple[float, ...] = number((10.0, 20.0, 30.0), least=0, most=60, length=3)
    # diameter of a hill or hollow: a lying body has room on one slope
    slope_block_m: float = number(12.0, least=8, most=100)
    # times the differences within the height map that the policy sees: a body's height over the
    # ground varies by .35 m (std), the ground below it on a slope of 10 degrees by .05 m
    relief_gain: float = number(4.0, above=0, most=100)
    # rag-dolls dropped on the irregular regions for lying starts
    drops: int = number(5000, least=1, most=200_000)
    curriculum: str = "success"  # what opens the next region: success | schedule | none (all open)
    # success: this many in the newest region
    unlock_successes: int = number(200, least=1, most=MOST_COUNT)
    # schedule: control steps a region
    schedule_steps: int = number(20_000_000, least=1, most=MOST_COUNT)

    def __post_init__(self) -> None:
        check_numbers(self, "terrain")
        for name in ("rough_m", "slope_deg"):
            easy, medium, hard = values = getattr(self, name)
            expected = "three values that do not fall: easy, medium, hard"
            require(easy <= medium <= hard, f"terrain.{name}", expected, values)
        kinds = ("success", "schedule", "none")
        ok = self.curriculum in kinds
        require(ok, "terrain.curriculum", f"one of {kinds}", self.curriculum)
        if self.heights is None:
            expected = "null, as it belongs to terrain.heights"
            require(self.height_m is None, "terrain.height_m", expected, self.height_m)
            self._check_sizes()
        else:
            expected = f"at least {_LEAST_OWN_M:g} m"
            ok = self.region_size_m >= _LEAST_OWN_M
            require(ok, "terrain.region_size_m", expected, self.region_size_m)
            self._check_multiples(
                ("region_size_m", 2 * self.grid_step_m, "2 x terrain.grid_step_m"),
                ("border_m", self.grid_step_m, "terrain.grid_step_m"),
            )

    def _check_sizes(self) -> None:
        ok = self.region_size_m >= 2 * self.slope_block_m
        expected = f"at least 2 x terrain.slope_block_m = {2 * self.slope_block_m:g} m"
        require(ok, "terrain.region_size_m", expected, self.region_size_m)
        self._check_multiples(
            ("region_size_m", 2 * self.slope_block_m, "2 x terrain.slope_block_m"),
            ("region_size_m", 2 * self.tile_m, "2 x terrain.tile_m"),
            ("slope_block_m", 2 * self.grid_step_m, "2 x terrain.grid_step_m"),
            ("tile_m", self.grid_step_m, "terrain.grid_step_m"),
            ("border_m", self.grid_step_m, "terrain.grid_step_m"),
        )

    def _check_multiples(self, *pairs: tuple[str, float, str]) -> None:
        """Each a setting, the length (m) that it is a multiple of, and what that is."""
        for name, unit, text in pairs:
            value = getattr(self, name)
            ok = abs(value / unit - round(value / unit)) < 1e-6 and value >= unit
            require(ok, f"terrain.{name}", f"a multiple of {text} = {unit:g} m", value)


@dataclasses.dataclass(frozen=True)
class MotionConfig:
    """Which motions give the start poses, the curves and the pose prior's data.

    A source that ends in .yaml is a curve file: a style without a motion, see curve_file.py.
    """

    source: tuple[str, ...] = ("authored",)  # `authored`, `deepmimic`, folders or files
    curves: tuple[str, ...] = ()  # names of the get-ups to train on; empty: all that are found
    mirror: bool = True  # double the pose data by mirroring
    # poses that the authored motions are varied into for the prior
    augment_poses: int = number(20_000, least=0, most=1_000_000)
    # standard deviation of the joint noise in them
    augment_noise_rad: float = number(0.05, least=0, most=math.pi)

    def __post_init__(self) -> None:
        check_numbers(self, "motion")


@dataclasses.dataclass(frozen=True)
class PriorConfig:
    """The conditional pose VAE."""

    conditional: bool = True  # False: the standard pose VAE, for the ablation
    latent_size: int = number(16, least=1, most=1024)  # Z
    # of encoder and decoder
    hidden_sizes: tuple[int, ...] = number((256, 256), least=1, most=4096, length=(0, 8))
    mirror: bool = True  # equivariant: the image of a latent decodes to the image of its pose
    beta: float = number(1e-6, least=0, most=1000)  # weight of the KL term
    learning_rate: float = number(1e-4, above=0, most=1)  # of AdamW, at first
    # share of it at the end, reached along a half cosine; 1: constant
    last_rate: float = number(1.0, least=0, most=1)
    # AdamW's, decoupled from the gradient; 0: Adam
    weight_decay: float = number(0.0, least=0, most=10)
    # on the encoder's input, in standard deviations of each hinge
    input_noise: float = number(0.0, least=0, most=10)
    epochs: int = number(100, least=1, most=1_000_000)  # passes over the poses
    batch_size: int = number(128, least=1, most=1_000_000)  # poses of an update
    # small pose sets get more epochs, until this many updates
    min_updates: int = number(20_000, least=0, most=100_000_000)
    holdout: float = number(0.1, above=0, below=1)  # share of the poses kept for the report
    seed: int = number(0, least=0, most=LAST_SEED)  # of weights, noise and order

    def __post_init__(self) -> None:
        check_numbers(self, "prior")
