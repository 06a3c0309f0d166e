"""Settings of the initialization, apart from the code they configure: the command line loads only these."""

from dataclasses import dataclass
from typing import Literal

from digs_warp.checks import DigsError, check_positive
from digs_warp.init.seed_gaussians import INITIAL_OPACITY

Strategy = Literal["default", "random", "depth", "highdepth", "fusion"]
VoxelUnit = Literal["metre", "object", "sfm"]
Shape = Literal["round", "flat", "ray"]
ScaleStatistic = Literal["mode", "mean"]

# Edge length of the voxel grid without a wish of the user's: (high density, low density). The paper's are
# in units of structure from motion; ours in metres keep their ratio, and so do shares of the object.
VOXEL_SIZES: dict[VoxelUnit, tuple[float, float]] = {
    "sfm": (0.04, 0.1),
    "metre": (0.004, 0.01),
    "object": (0.008, 0.02),
}

# Strategies whose points cover the surface, and how their Gaussians start. Measured on the YCB mustard bottle
# (1600x900, 38,000 points 3 mm apart, rates of 3DGS): 30.7 dB after 100 steps, against 27.7 dB with
# opacity 0.1 and width 1, in two thirds of the time.
DENSE_STRATEGIES: tuple[Strategy, ...] = ("depth", "highdepth", "fusion")
DENSE_OPACITY = 0.8
DENSE_WIDTH = 0.6


@dataclass(frozen=True, kw_only=True)
class InitConfig:
    """How depth maps and sparse points become the points that the optimization starts from."""

    strategy: Strategy = "highdepth"
    """Where the points come from: depth maps in fine voxels ('highdepth') or coarse ones ('depth'), sparse
    points of matched images, background included ('default'), both kinds ('fusion': fine texture on top of
    complete surfaces), or nowhere ('random', for comparison). The last three match the images first."""

    voxel_size: float | None = None
    """Edge length of the voxel grid: one point per occupied voxel. Default: 4 mm ('depth': 10 mm), which
    give an object of half a metre about 25,000 (4,000) points. Smaller: finer detail, slower training."""

    voxel_unit: VoxelUnit = "metre"
    """Unit of the voxel size: 'metre', 'object' (shares of the object's longest side, default 0.008 and
    0.02: the same number of points for a cup and a car) or 'sfm' (that of structure from motion, default
    0.04 and 0.1, as in the paper)."""

    target_points: int | None = None
    """Choose the voxel size that gives about this many points, instead of naming one."""

    max_points: int | None = None
    """Keep at most this many of the points from depth, drawn at random: bounds the time of a training step
    without a coarser grid."""

    scale: ScaleStatistic = "mode"
    """What the ratios between depth in structure from motion and measured depth agree on: their 'mode' (paper
    eq. 7), or, for comparison, their 'mean', which every mismatch pulls at."""

    mask_filter: bool = True
    """Leave out depth outside the object's mask (paper eq. 9). Without it only the other filters tell the
    object from its surround; the training keeps to the masks all the same."""

    mask_threshold: int = 20
    """A pixel belongs to the object where its mask (0 to 255) is above this (paper section 4.1)."""

    edge_filter: bool = True
    """Leave out depth at jumps, where stereo is least reliable (paper eq. 9)."""

    foreground_filter: bool = True
    """Leave out the far one of two clusters of depth: background that a mask lets in (paper eq. 9)."""

    background_weight: float = 3.0
    """How many times nearer to the background's mean depth than to the foreground's a pixel has to be to
    count as background (paper section 4.1)."""

    min_support: float = 0.15
    """Leave out voxels with fewer measurements than this fraction of the median voxel: what only a stray
    measurement or two saw is an outlier. 0 keeps all."""

    weight_by_uncertainty: bool = False
    """Weigh measurements by how certain stereo is of them, 1 / depth^4: near views count more."""

    weight_by_confidence: bool = False
    """Weigh measurements by the confidence that the sensor reported for them."""

    visibility_check: bool = True
    """Leave out points that more views have seen through than seen: floaters around the object."""

    shape: Shape = "round"
    """Gaussians at the start: 'round'; 'flat' along the surface, by the normals of the depth maps; or
    drawn out along the 'ray' by the uncertainty of the depth."""

    disparity_noise: float = 0.15
    """Standard deviation of the sensor's disparity [px]; how far shape 'ray' draws out."""

    opacity: float | None = None
    """Opacity of every Gaussian at the start, above 0 and below 1. Default: 0.8 for points from depth, which
    lie on the surface; 0.1 (3DGS) for sparse or random ones."""

    splat_width: float | None = None
    """Standard deviation of every Gaussian at the start, as a share of the distance to its neighbours.
    Default: 0.6 for points from depth, which cover the surface already; 1 (3DGS) for the others."""

    def __post_init__(self) -> None:
        if self.voxel_size is not None:
            check_positive("init.voxel_size", self.voxel_size)
        check_positive("init.disparity_noise", self.disparity_noise)
        if self.target_points is not None and self.target_points < 1:
            raise DigsError(f"init.target_points: {self.target_points}, expected at least 1")
        if self.max_points is not None and self.max_points < 1:
            raise DigsError(f"init.max_points: {self.max_points}, expected at least 1")
        if self.target_points is not None and self.voxel_size is not None:
            raise DigsError("init.voxel_size and init.target_points: give one of them")
        if not self.background_weight >= 1:
            raise DigsError(f"init.background_weight: {self.background_weight}, expected 1 or more")
        if not 0 <= self.min_support <= 1:
            raise DigsError(f"init.min_support: {self.min_support}, expected 0 to 1")
        if not 0 < self.seed_opacity < 1:
            raise DigsError(f"init.opacity: {self.opacity}, expected above 0 and below 1")
        check_positive("init.splat_width", self.seed_width)
        if not 0 <= self.mask_threshold < 255:
            raise DigsError(f"init.mask_threshold: {self.mask_threshold}, expected 0 to 254")

    @property
    def seed_opacity(self) -> float:
        """The opacity at the start, default resolved."""
        if self.opacity is not None:
            return self.opacity
        return DENSE_OPACITY if self.strategy in DENSE_STRATEGIES else INITIAL_OPACITY

    @property
    def seed_width(self) -> float:
        """The width at the start, default resolved."""
        if self.splat_width is not None:
            return self.splat_width
        return DENSE_WIDTH if self.strategy in DENSE_STRATEGIES else 1.0

    @property
    def mask_level(self) -> int:
        """Mask values above this are the object's: all of them without the filter."""
        return self.mask_threshold if self.mask_filter else -1

    @property
    def voxel_edge(self) -> float:
        """Edge length of the voxel grid in ``voxel_unit``."""
        high, low = VOXEL_SIZES[self.voxel_unit]
        return self.voxel_size or (low if self.strategy == "depth" else high)
