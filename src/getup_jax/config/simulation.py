"""The simulated body, the ground under it, the motions and the pose prior made of them."""

from __future__ import annotations

import dataclasses

from getup_jax.config.check import require


@dataclasses.dataclass(frozen=True)
class PhysicsConfig:
    """The simulator: engine, rate and servo."""

    engine: str = "auto"  # auto | native | mjx | mjx-warp; auto: the fastest here
    character: str = "humanoid49"  # assets/NAME.xml, or a path to an MJCF file
    control_hz: int = 30  # policy rate
    substeps: int = 2  # physics steps in one control period
    solver: str = "auto"  # newton | cg | pgs; auto: pgs on native, newton on MJX, which has no pgs
    iterations: int = 10  # solver iterations at most
    gain_scale: float = 1.5  # times the stiffness and damping of the MJCF file
    torque_scale: float = 1.0  # times the torque limits of the MJCF file
    armature: float = 0.1  # kg m^2, added to every hinge
    damping: float = 1.0  # Nms/rad of every hinge; all that a servo at its torque limit has
    threads: int = 0  # native: worker threads; 0: every CPU this process may use

    def __post_init__(self) -> None:
        engines = ("auto", "native", "mjx", "mjx-warp")
        require(self.engine in engines, "physics.engine", f"one of {engines}", self.engine)
        solvers = ("auto", "newton", "cg", "pgs")
        require(self.solver in solvers, "physics.solver", f"one of {solvers}", self.solver)
        mjx_pgs = self.engine.startswith("mjx") and self.solver == "pgs"
        expected = "auto, newton or cg, since MJX has no PGS"
        require(not mjx_pgs, "physics.solver", expected, self.solver)
        for name in ("control_hz", "substeps", "iterations", "gain_scale", "torque_scale"):
            require(getattr(self, name) > 0, f"physics.{name}", "more than 0", getattr(self, name))
        for name in ("armature", "damping"):
            require(getattr(self, name) >= 0, f"physics.{name}", "at least 0", getattr(self, name))
        require(self.threads >= 0, "physics.threads", "at least 0", self.threads)


@dataclasses.dataclass(frozen=True)
class TerrainConfig:
    """Irregular ground in four regions: flat, easy, medium and hard [P 3.2, 5.4].

    Half of each irregular region is rough, and half has even slopes in all directions.
    """

    seed: int = 0  # another seed is another ground of the same kind
    region_size_m: float = 48.0  # side of a region, a square
    border_m: float = 4.0  # flat ground around the regions
    grid_step_m: float = 0.5  # between two heights of the field
    tile_m: float = 1.0  # side of a tile of the rough ground
    rough_m: tuple[float, ...] = (0.06, 0.13, 0.2)  # its corners move up or down by at most this
    slope_deg: tuple[float, ...] = (10.0, 20.0, 30.0)  # steepest slope of easy, medium, hard
    slope_block_m: float = 12.0  # diameter of a hill or hollow
    # times the differences within the height map that the policy sees: a body's height over the
    # ground varies by .35 m (std), the ground below it on a slope of 10 degrees by .05 m
    relief_gain: float = 4.0
    drops: int = 5000  # rag-dolls dropped on the irregular regions for lying starts
    curriculum: str = "success"  # what opens the next region: success | schedule | none (all open)
    unlock_successes: int = 200  # success: this many in the newest region
    schedule_steps: int = 20_000_000  # schedule: control steps a region

    def __post_init__(self) -> None:
        for name in ("region_size_m", "grid_step_m", "tile_m", "slope_block_m"):
            require(getattr(self, name) > 0, f"terrain.{name}", "more than 0", getattr(self, name))
        for name in ("unlock_successes", "schedule_steps", "drops"):
            require(getattr(self, name) > 0, f"terrain.{name}", "more than 0", getattr(self, name))
        for name in ("rough_m", "slope_deg"):
            values = getattr(self, name)
            ok = len(values) == 3 and 0 <= values[0] <= values[1] <= values[2]
            expected = "three values of at least 0 that do not fall: easy, medium, hard"
            require(ok, f"terrain.{name}", expected, values)
        ok = max(self.slope_deg) <= 60
        require(ok, "terrain.slope_deg", "at most 60 degrees", self.slope_deg)
        require(self.relief_gain > 0, "terrain.relief_gain", "more than 0", self.relief_gain)
        kinds = ("success", "schedule", "none")
        ok = self.curriculum in kinds
        require(ok, "terrain.curriculum", f"one of {kinds}", self.curriculum)
        self._check_sizes()

    def _check_sizes(self) -> None:
        require(self.border_m >= 2, "terrain.border_m", "at least 2 m", self.border_m)
        ok = self.grid_step_m >= 0.5
        expected = "at least 0.5 m, since collisions with a finer field are slow"
        require(ok, "terrain.grid_step_m", expected, self.grid_step_m)
        ok = self.slope_block_m >= 8
        expected = "at least 8 m, so that a lying body has room on one slope"
        require(ok, "terrain.slope_block_m", expected, self.slope_block_m)
        ok = self.region_size_m >= 2 * self.slope_block_m
        expected = f"at least 2 x terrain.slope_block_m = {2 * self.slope_block_m:g} m"
        require(ok, "terrain.region_size_m", expected, self.region_size_m)
        pairs = (
            ("region_size_m", 2 * self.slope_block_m, "2 x terrain.slope_block_m"),
            ("region_size_m", 2 * self.tile_m, "2 x terrain.tile_m"),
            ("slope_block_m", 2 * self.grid_step_m, "2 x terrain.grid_step_m"),
            ("tile_m", self.grid_step_m, "terrain.grid_step_m"),
            ("border_m", self.grid_step_m, "terrain.grid_step_m"),
        )
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
    augment_poses: int = 20_000  # poses that the authored motions are varied into for the prior
    augment_noise_rad: float = 0.05  # standard deviation of the joint noise in them


@dataclasses.dataclass(frozen=True)
class PriorConfig:
    """The conditional pose VAE."""

    conditional: bool = True  # False: the standard pose VAE, for the ablation
    latent_size: int = 16
    hidden_sizes: tuple[int, ...] = (256, 256)
    mirror: bool = True  # equivariant: the image of a latent decodes to the image of its pose
    beta: float = 1e-6  # weight of the KL term
    learning_rate: float = 1e-4
    last_rate: float = 1.0  # share of it at the end, reached along a half cosine; 1: constant
    weight_decay: float = 0.0  # AdamW's, decoupled from the gradient; 0: Adam
    input_noise: float = 0.0  # on the encoder's input, in standard deviations of each hinge
    epochs: int = 100
    batch_size: int = 128
    min_updates: int = 20_000  # small pose sets get more epochs, until this many updates
    holdout: float = 0.1  # share of the poses kept for the report
    seed: int = 0

    def __post_init__(self) -> None:
        require(0 < self.holdout < 1, "prior.holdout", "between 0 and 1", self.holdout)
        require(0 <= self.last_rate <= 1, "prior.last_rate", "between 0 and 1", self.last_rate)
        for name in ("weight_decay", "input_noise"):
            require(getattr(self, name) >= 0, f"prior.{name}", "at least 0", getattr(self, name))
        for name in ("latent_size", "learning_rate", "epochs", "batch_size"):
            require(getattr(self, name) > 0, f"prior.{name}", "more than 0", getattr(self, name))
