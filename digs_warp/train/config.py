"""Settings of the training. Imports nothing heavy: the command line reads its help from here.

A setting that is None takes the default that its help names.
"""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from tyro.conf import arg

from digs_warp.geometry.sh import USUAL_DEGREE
from digs_warp.record.durations import DURATION
from digs_warp.settings import (
    ITERATIONS,
    LEARNING_RATE,
    MANY,
    NO_FLAG,
    SECONDS,
    SEED,
    SPLATS,
    WEIGHT,
    Range,
    Settings,
)
from digs_warp.train.rates import DENSE_RATES, LearningRates, rates_of_sparse_start

DensityStrategy = Literal["fixed", "adaptive"]

# Weight of the measured depth: see "The surface" in docs/training.md.
DEPTH_WEIGHT = 0.008

# The random streams of a run: one separate stream for each purpose, all derived from its seed. A draw follows
# from (seed, purpose, step or epoch), and its row i belongs to Gaussian i: nothing depends on the order of
# threads, and a resumed run draws the same numbers as an uninterrupted one.
VIEW_ORDER, BACKGROUND, SPLIT = range(3)

# Iterations after which held-out views are measured: denser at first, where quality rises fast.
EVALUATE_AT = (100, 300, 500, 1000, 3000, 7000, 12000)


@dataclass(frozen=True, kw_only=True)
class Stop(Settings):
    """When a run ends: at whichever limit it reaches first."""

    iterations: Annotated[int, ITERATIONS] = 1000
    """Training steps; each uses one view. Learning rates and schedules span all of them."""

    time_budget: Annotated[float | None, DURATION, SECONDS] = None
    """Plan the training for this much time, for example 60s, 20min or 2h: after a few steps it chooses how
    many fit, at most --iterations, so that all schedules end with the time. Default: no limit."""


@dataclass(frozen=True, kw_only=True)
class Density(Settings):
    """How the number of Gaussians changes during a run."""

    strategy: Annotated[DensityStrategy, arg(name="density")] = "fixed"
    """How the number of Gaussians changes. fixed: it does not, best for a dense start from depth; adaptive:
    clone, split, prune and reset as in 3DGS."""

    max_splats: Annotated[int, SPLATS] = 1_000_000
    """The number of Gaussians never grows beyond this."""


@dataclass(frozen=True, kw_only=True)
class TrainConfig(Settings):
    """How the Gaussians are optimized."""

    stop: Stop = field(default_factory=Stop)
    density: Density = field(default_factory=Density)

    sh_degree: Annotated[int | None, Range(0, 3)] = None
    """View-dependent color: degree of the spherical harmonics, 0 (none) to 3. Default: 1 for matte objects, 3
    for shiny ones, as the photographs show before the training."""

    depth_weight: Annotated[float | None, WEIGHT] = None
    """Weight of the difference between rendered and measured depth: holds the surface where it was measured.
    Default: 0.008 where the recording has depth."""

    fit_exposure: Literal["on", "off"] = "on"
    """Exposure and white balance of each photograph. on: fitted, so that the colors of the Gaussians
    are those of all photographs; off: taken as equal in all of them."""

    rolling_shutter: Literal["auto", "on", "off"] = "auto"
    """Draw every Gaussian from the pose at which its row was read. Needs the read-out time and the motion of
    the camera, which a recording tells, or --readout-time and frames at most 0.15 s apart. auto: where the
    image of the object moves by 0.1 px or more while the rows are read."""

    motion_blur: Literal["auto", "on", "off"] = "auto"
    """Draw a photograph as the mean of views from poses along its exposure. Needs the exposure time, and, as
    --rolling-shutter does, the motion of the camera. auto: where the image of the object moves by 2 px or
    more in that time; on: by 0.5 px."""

    # No video camera exposes longer; a larger number was meant in milliseconds.
    exposure_time: Annotated[float | None, Range(0, 1, "seconds"), NO_FLAG] = None
    """Motion blur: how long each row was exposed [s]; 0: for an instant. Default: as the recording says."""

    learning_rate: Annotated[float, LEARNING_RATE, NO_FLAG] = 1.0
    """Factor on all learning rates."""

    image_memory: Annotated[float, Range(1e-12, MANY), NO_FLAG] = 2048.0
    """Memory for photographs [MiB]. Those that do not fit are read again in the background."""

    evaluate_at: Annotated[tuple[int, ...], ITERATIONS, NO_FLAG] = EVALUATE_AT
    """Measure the held-out views every this many iterations, and at the first and the last one."""

    keep_course: bool = False
    """Keep the Gaussians whenever held-out views are measured: `view` then has a slider from the start to the
    result, without view-dependent color. Each snapshot takes 56 bytes per Gaussian on disk."""

    seed: Annotated[int, SEED, NO_FLAG] = 0
    """Seed of the order of the views, the random backgrounds and everything random in --density."""

    device: str = "cpu"
    """Warp device: cpu or cuda."""

    @property
    def usual_sh_degree(self) -> int:
        """The degree of the color; that of matte objects where the recording is to decide."""
        return USUAL_DEGREE if self.sh_degree is None else self.sh_degree

    def resolved_depth_weight(self, is_measured: bool) -> float:
        """Return the weight of the measured depth; ``is_measured``: some view of the training has depth."""
        default = DEPTH_WEIGHT if is_measured else 0.0
        return default if self.depth_weight is None else self.depth_weight

    def reads_depth(self, frame_has_depth: bool) -> bool:
        """Whether a frame's depth is read; a weight that was asked for needs depth in every frame."""
        return self.resolved_depth_weight(frame_has_depth) > 0

    @property
    def learning_rates(self) -> LearningRates:
        """The rates of the strategy."""
        dense = self.density.strategy == "fixed"
        rates = DENSE_RATES if dense else rates_of_sparse_start(self.stop.iterations)
        return rates.scaled(self.learning_rate)
