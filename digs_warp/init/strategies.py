"""The five initializations of the paper (sections 3.3 and 4.1) and two of ours: needs and defaults.

To add one: give it a name and a row here, and say in `digs_warp.init.recipes.initialize` where its points
come from. Nothing else knows the strategies by name.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

StrategyName = Literal["default", "random", "depth", "highdepth", "fusion", "hull", "mvs"]
StrategyChoice = Literal["auto", StrategyName]
VoxelUnit = Literal["metre", "object", "sfm"]

# Edge lengths of the voxel grid. The paper's are in units of structure from motion; those as fractions of the
# object's size keep their ratio. In metres there is no default that fits a cup and a car: the voxels then are
# as large as this many pixels at the object's distance.
FINE_VOXELS: Mapping[VoxelUnit, float] = {"sfm": 0.04, "object": 0.008}
COARSE_VOXELS: Mapping[VoxelUnit, float] = {"sfm": 0.1, "object": 0.02}
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
        voxel_sizes: edge length of the voxel grid by its unit; only points from depth are put on a grid.
        voxel_pixels: the same in pixels at the object's distance, where nothing else is said.
        opacity: of every Gaussian at the start.
        width: standard deviation of every Gaussian at the start, as a fraction of the distance to its
            neighbors.
        density: how the number of Gaussians changes during training, a value of `--density`.
    """

    needs_sfm: bool
    voxel_sizes: Mapping[VoxelUnit, float]
    voxel_pixels: float
    opacity: float
    width: float
    density: Literal["fixed", "adaptive"]


_SPARSE = Strategy(True, FINE_VOXELS, FINE_PIXELS, REFERENCE_OPACITY, REFERENCE_WIDTH, "adaptive")
STRATEGIES: Mapping[StrategyName, Strategy] = {
    "default": _SPARSE,
    "random": _SPARSE,
    "depth": Strategy(False, COARSE_VOXELS, COARSE_PIXELS, DENSE_OPACITY, DENSE_WIDTH, "fixed"),
    "highdepth": Strategy(False, FINE_VOXELS, FINE_PIXELS, DENSE_OPACITY, DENSE_WIDTH, "fixed"),
    "fusion": Strategy(True, FINE_VOXELS, FINE_PIXELS, DENSE_OPACITY, DENSE_WIDTH, "fixed"),
    "hull": Strategy(False, FINE_VOXELS, FINE_PIXELS, DENSE_OPACITY, DENSE_WIDTH, "fixed"),
    # Where photographs hardly match, the training has to find the places that lack splats.
    "mvs": Strategy(False, FINE_VOXELS, FINE_PIXELS, DENSE_OPACITY, DENSE_WIDTH, "adaptive"),
}


def chosen_strategy(choice: StrategyChoice, has_depth: bool) -> StrategyName:
    """Return the strategy that a user chose; 'auto' takes depth, else that of matched photographs."""
    if choice != "auto":
        return choice
    return "highdepth" if has_depth else "mvs"


def start_reason(strategy: StrategyName, sources: dict[str, int], has_depth: bool) -> str:
    """Return a phrase such as "the sparse points of the recording, which has no depth".

    Args:
        strategy: how the points were made.
        sources: number of points by where they came from, as in `Start`.
        has_depth: whether a frame has a depth map.
    """
    lacks = "" if has_depth else "; the recording has no depth"
    if strategy == "mvs":
        return "depth that matching the photographs tells"
    if strategy in ("hull", "random"):
        return ("the visual hull of the masks" if strategy == "hull" else "random points") + lacks
    if strategy == "default" and "recorded" in sources:
        return "the sparse points of the recording" + ("" if has_depth else ", which has no depth")
    if strategy == "default":
        return "sparse points matched in the images" + lacks
    sparse = ", and sparse points matched in the images" if strategy == "fusion" else ""
    closed = "; closed where no view saw the object" if "unseen" in sources else ""
    return "points from the depth maps" + sparse + closed
