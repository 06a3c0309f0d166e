"""Gaussians -> a coloured triangle mesh: where to look from, how fine, what to leave out."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.camera import Camera
from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.record.progress import progress
from digs_warp.surface.depth_views import DepthView, depth_views
from digs_warp.surface.fuse import fuse_views
from digs_warp.surface.parts import Cleaned, remove_floaters

# Voxels along the ball around the scene where the user names no size.
VOXELS_ACROSS = 160

# Depth beyond this many radii around the centre is no part of the object.
BALL_MARGIN = 1.3

# Mask values of a segmentation above this are object.
OBJECT_THRESHOLD = 127

Mask = Callable[[], np.ndarray]


@dataclass(frozen=True, eq=False)
class Scene:
    """The ball in the world [m] that holds the object."""

    center_world: np.ndarray
    radius: float

    @property
    def voxel(self) -> float:
        """The voxel size [m] where none is given."""
        return 2 * self.radius / VOXELS_ACROSS


def extract_surface(
    gaussians: Gaussians,
    cameras: Sequence[Camera],
    scene: Scene,
    voxel: float | None = None,
    masks: Sequence[Mask] | None = None,
    device: str = "cpu",
) -> Cleaned:
    """Return the surface of the Gaussians as the cameras see it, without floaters.

    Args:
        gaussians: of one object.
        cameras: all around it; parts that fewer than three see are missing.
        scene: where the object is.
        voxel: edge of a voxel [m]; default: the ball's diameter / 160.
        masks: load the object mask of each camera, (height, width), uint8: depth outside is left out.
        device: "cpu" or a CUDA device of Warp; the fusion runs on the CPU.

    Raises:
        DigsError: the cameras see no surface, or the voxels are too small.
    """
    views: Iterable[DepthView] = depth_views(gaussians, cameras, scene.center_world, device)
    if masks is not None:
        views = (within_mask(view, load()) for view, load in zip(views, masks, strict=True))
    mesh = fuse_views(
        _with_progress(views, len(cameras)),
        scene.voxel if voxel is None else voxel,
        scene.center_world,
        BALL_MARGIN * scene.radius,
    )
    if not len(mesh):
        raise DigsError(
            f"surface: the {len(cameras)} cameras see none: too few of them, or Gaussians too faint to "
            "cover half of a pixel; train longer, or choose larger voxels"
        )
    return remove_floaters(mesh)


def within_mask(view: DepthView, mask: np.ndarray) -> DepthView:
    """Return the view with depth where the mask says object; ``mask`` is (height, width), 0..255."""
    depth = np.where(mask > OBJECT_THRESHOLD, view.depth, np.float32(np.nan))
    return DepthView(view.camera, view.color, depth)


def _with_progress(views: Iterable[DepthView], count: int) -> Iterator[DepthView]:
    with progress(count, "Fusing depth", "view") as bar:
        for view in views:
            yield view
            bar.update()
