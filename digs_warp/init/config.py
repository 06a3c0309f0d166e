"""Settings of the initialization, apart from the code they configure: the command line loads only these."""

from dataclasses import dataclass

from digs_warp.checks import DigsError, check_positive
from digs_warp.init.seed_gaussians import INITIAL_OPACITY


@dataclass(frozen=True, kw_only=True)
class InitConfig:
    """How depth maps become the points that the optimization starts from."""

    voxel_size: float = 0.004
    """Edge length of the voxel grid [m]: one point per occupied voxel. 4 mm give an object of half a
    metre about 25,000 points."""

    mask_threshold: int = 20
    """A pixel belongs to the object where its mask (0 to 255) is above this (paper section 4.1)."""

    edge_filter: bool = True
    """Leave out depth at jumps, where stereo is least reliable (paper eq. 9)."""

    min_support: float = 0.15
    """Leave out voxels with fewer measurements than this fraction of the median voxel: what only a stray
    measurement or two saw is an outlier. 0 keeps all."""

    opacity: float = INITIAL_OPACITY
    """Opacity of every Gaussian at the start, above 0 and below 1."""

    def __post_init__(self) -> None:
        check_positive("init.voxel_size", self.voxel_size)
        if not 0 <= self.min_support <= 1:
            raise DigsError(f"init.min_support: {self.min_support}, expected 0 to 1")
        if not 0 < self.opacity < 1:
            raise DigsError(f"init.opacity: {self.opacity}, expected above 0 and below 1")
        if not 0 <= self.mask_threshold < 255:
            raise DigsError(f"init.mask_threshold: {self.mask_threshold}, expected 0 to 254")
