"""Settings of the initialization, kept apart from its code so that the command line loads quickly.

There are the five initializations of the paper (sections 3.3 and 4.1) and two of ours. To add one: give it a
name and a row here, and say in `digs_warp.init.recipes.initialize` where its points come from. Nothing else
knows them by name.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from digs_warp.checks import DigsError
from digs_warp.settings import NO_FLAG, SPLATS, VOXEL, Settings

StrategyName = Literal["default", "random", "depth", "highdepth", "fusion", "hull", "mvs"]
StrategyChoice = Literal["auto", StrategyName]

# A pixel belongs to the object if its mask value (0 to 255) is above this (paper section 4.1, tau).
MASK_THRESHOLD = 20

# Edge lengths of the voxel grid [px] at the object's distance, in the paper's ratio: a length in metres would
# not fit a cup and a car.
FINE_PIXELS, COARSE_PIXELS = 2.0, 5.0

# Points from depth cover the surface. Measured on the YCB mustard bottle (1600x900, 38,000 points 3 mm apart,
# rates of 3DGS): after 100 steps 30.7 dB with the dense start, in two thirds of the time; 27.7 dB with the
# start of 3DGS.
DENSE_OPACITY, DENSE_WIDTH = 0.8, 0.6
REFERENCE_OPACITY, REFERENCE_WIDTH = 0.1, 1.0


@dataclass(frozen=True)
class Strategy:
    """What an initialization needs, and its defaults.

    Attributes:
        needs_sfm: whether it uses the sparse points of structure from motion, or at least their number.
        voxel_pixels: edge length of the voxel grid in pixels at the object's distance.
        opacity: of every Gaussian at the start.
        width: standard deviation of every Gaussian at the start, as a fraction of the distance to its
            neighbors.
        density: how the number of Gaussians changes during training, a value of `--density`.
    """

    needs_sfm: bool = False
    voxel_pixels: float = FINE_PIXELS
    opacity: float = DENSE_OPACITY
    width: float = DENSE_WIDTH
    density: Literal["fixed", "adaptive"] = "fixed"


_SPARSE = Strategy(True, FINE_PIXELS, REFERENCE_OPACITY, REFERENCE_WIDTH, "adaptive")
STRATEGIES: Mapping[StrategyName, Strategy] = {
    "default": _SPARSE,
    "random": _SPARSE,
    "depth": Strategy(voxel_pixels=COARSE_PIXELS),
    "highdepth": Strategy(),
    "fusion": Strategy(needs_sfm=True),
    "hull": Strategy(),
    "mvs": Strategy(density="adaptive"),  # the gaps of an object; those of a scene are guessed
}


def chosen_strategy(choice: StrategyChoice, has_depth: bool) -> StrategyName:
    """Return the strategy that a user chose; 'auto' takes depth, else that of matched photographs."""
    if choice != "auto":
        return choice
    return "highdepth" if has_depth else "mvs"


@dataclass(frozen=True, kw_only=True)
class InitConfig(Settings):
    """How depth maps and sparse points become the points that the optimization starts from."""

    strategy: StrategyName = "highdepth"
    """Where the points come from. highdepth: depth maps in fine voxels; depth: depth maps in coarse voxels;
    default: the paper's name for sparse points, background included (our default is highdepth); fusion: both,
    for fine texture on complete surfaces; mvs: depth that matching the photographs tells (multi-view stereo);
    hull: the places that all masks agree on; random: random points, for comparison. Default, fusion and
    random match the images, unless sparse points came with them."""

    voxel_size: Annotated[float | None, VOXEL] = None
    """Edge length of the voxel grid: one point per occupied voxel. Smaller voxels give finer detail and
    slower training. Default: two pixels (depth: five) at the object's distance, at most 200,000 points."""

    target_points: Annotated[int | None, SPLATS] = None
    """Choose the voxel size that gives about this many points. Default: use --voxel-size."""

    edge_filter: Annotated[bool, NO_FLAG] = True
    """Drop depth at jumps, where stereo is least reliable (paper eq. 9)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.target_points is not None and self.voxel_size is not None:
            raise DigsError("--voxel-size and --target-points: give one of them")

    @property
    def needs_sfm(self) -> bool:
        """Whether images have to be matched, unless sparse points came with the recording."""
        is_counted = self.strategy == "random" and self.target_points is not None
        return self.defaults.needs_sfm and not is_counted

    @property
    def takes_recorded_points(self) -> bool:
        """Whether sparse points that came with the recording do instead; fusion asks which view saw which."""
        return self.strategy == "mvs" or (self.needs_sfm and self.strategy != "fusion")

    @property
    def defaults(self) -> Strategy:
        """What goes with the strategy."""
        return STRATEGIES[self.strategy]
