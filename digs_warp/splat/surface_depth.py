"""The depth of the surface that Gaussians show, from the two depths that a view gives.

The expected depth is a mean over all splats that a pixel shows, and so smoother than the median depth, which
jumps from one splat to the next. But where a pixel shows two surfaces, at the edge of the nearer one, their
mean lies on neither. So the depth of the surface is the expected one where the two agree, else the median.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import PixelBox
from digs_warp.splat.camera_motion import RowMotion
from digs_warp.splat.config import EXPECTED, MEDIAN, DepthOf, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.renderer import SplatRenderer

# Expected and median depth further apart than this share of the depth belong to two surfaces: a centimetre
# at a metre, several times the depth of the soft layer that the splats of one surface are.
SAME_SURFACE = 0.01


def surface_place(is_object: bool) -> DepthOf:
    """Return the place of splats that lies on the surface.

    The mask of an object shows where it ends, which draws the centers of its splats inside. Without masks, as
    in a room, nothing does: the splats keep to the surface.
    """
    return "skin" if is_object else "center"


def drawn_surfaces(
    gaussians: DeviceGaussians,
    cameras: Sequence[Camera],
    center_world: np.ndarray,
    is_object: bool,
    rows: Sequence[RowMotion | None] | None = None,
) -> Iterator[SplatRenderer]:
    """Yield the same renderer for each camera, with its view on black and the depths of the surface.

    Args:
        gaussians: the scene.
        cameras: where to look from; images may differ in size.
        center_world: where the scene is, for the near plane [m].
        is_object: of one object, trained with masks; False: of all in view, see `surface_place`.
        rows: how each camera moves while its rows are read; None: not at all.
    """
    if not cameras:
        return
    sizes = [camera.intrinsics for camera in cameras]
    renderer = SplatRenderer(
        gaussians,
        max(k.width for k in sizes),
        max(k.height for k in sizes),
        options=RasterOptions(outputs="depth", depth_of=surface_place(is_object)),
    )
    for camera, motion in zip(cameras, rows or [None] * len(cameras), strict=True):
        near = near_plane(camera, center_world)
        renderer.forward(camera, near=near, background=(0.0, 0.0, 0.0), rows=motion)
        yield renderer


def surface_depth(drawn: np.ndarray) -> np.ndarray:
    """Return the depth of the surface [m]; NaN where the Gaussians cover less than half of a pixel.

    Args:
        drawn: expected and median depth [m], 0 where there is none, shape (..., 2), float32.
    """
    expected, median = drawn[..., EXPECTED], drawn[..., MEDIAN]
    is_one = np.abs(expected - median) <= SAME_SURFACE * median
    return np.where(median > 0, np.where(is_one, expected, median), np.float32(np.nan))


def covered_depth(renderer: SplatRenderer, box: PixelBox) -> np.ndarray:
    """Return the expected depth of a part of the last view [m], (height, width), float64.

    It is 0 where the Gaussians cover less than half of a pixel.
    """
    depth = renderer.depth.part(box)[..., EXPECTED].astype(np.float64)
    return np.where(renderer.transmittance.part(box)[..., 0] < 0.5, depth, 0.0)
