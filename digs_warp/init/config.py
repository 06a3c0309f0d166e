"""Settings of the initialization, kept apart from its code so that the command line loads quickly."""

from dataclasses import dataclass
from typing import Annotated, Literal

from digs_warp.checks import DigsError
from digs_warp.init.strategies import STRATEGIES, StrategyName, VoxelUnit
from digs_warp.settings import NO_FLAG, SPLATS, VOXEL, Range, Settings

# A pixel belongs to the object if its mask value (0 to 255) is above this (paper section 4.1, tau).
MASK_THRESHOLD = 20


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

    voxel_unit: Annotated[VoxelUnit, NO_FLAG] = "metre"
    """Unit of the voxel size. metre; object: fraction of the object's longest side (default 0.008 and 0.02),
    the same number of points for a cup and a car; sfm: unit of structure from motion (default 0.04 and 0.1,
    as in the paper)."""

    target_points: Annotated[int | None, SPLATS] = None
    """Choose the voxel size that gives about this many points. Default: use --voxel-size."""

    mask_filter: Annotated[bool, NO_FLAG] = True
    """Drop depth outside the object's mask (paper eq. 9). Without it, only the other filters separate the
    object from its background; training uses the masks in any case."""

    edge_filter: Annotated[bool, NO_FLAG] = True
    """Drop depth at jumps, where stereo is least reliable (paper eq. 9)."""

    foreground_filter: Annotated[bool, NO_FLAG] = True
    """Split the depth into two clusters and drop the far one: background inside a mask that leaks (paper
    eq. 9)."""

    visibility_check: Annotated[bool, NO_FLAG] = True
    """Drop points that more views see through than confirm: floaters around the object."""

    fill_unseen: Annotated[Literal["auto", "on", "off"], NO_FLAG] = "auto"
    """Close the object where no view has seen it, in the colors around: without a back, views from there look
    into a shell. auto: with at most 6 views to train on, and masks."""

    opacity: Annotated[float | None, Range(1e-6, 1 - 1e-6), NO_FLAG] = None
    """Opacity of every Gaussian at the start, above 0 and below 1; where views disagree about depth, it is
    less (docs/training.md). Default: 0.8 for points from depth, which lie on the surface, 0.5 in a scene;
    0.1 (3DGS) for sparse or random ones."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.target_points is not None and self.voxel_size is not None:
            raise DigsError("--voxel-size and --target-points: give one of them")

    @property
    def needs_sfm(self) -> bool:
        """Whether images have to be matched, unless sparse points came with the recording."""
        is_counted = self.strategy == "random" and self.target_points is not None
        return STRATEGIES[self.strategy].needs_sfm and not is_counted

    @property
    def takes_recorded_points(self) -> bool:
        """Whether sparse points that came with the recording do instead; fusion asks which view saw which."""
        return self.strategy == "mvs" or (self.needs_sfm and self.strategy != "fusion")

    @property
    def seed_opacity(self) -> float:
        """The opacity at the start, default resolved."""
        return STRATEGIES[self.strategy].opacity if self.opacity is None else self.opacity

    @property
    def seed_width(self) -> float:
        """Standard deviation at the start, as a fraction of the distance to the neighbors."""
        return STRATEGIES[self.strategy].width

    @property
    def mask_level(self) -> int:
        """Mask values above this belong to the object; without the filter, all values do."""
        return MASK_THRESHOLD if self.mask_filter else -1

    @property
    def voxel_edge(self) -> float | None:
        """Edge length of the voxel grid in ``voxel_unit``; None: ``voxel_pixels`` at the object."""
        return self.voxel_size or STRATEGIES[self.strategy].voxel_sizes.get(self.voxel_unit)

    @property
    def voxel_pixels(self) -> float:
        """Edge length of the voxel grid in pixels at the object, where nothing else is said."""
        return STRATEGIES[self.strategy].voxel_pixels
