"""Depth and color of the surface that the Gaussians show, from each camera; drawn toward measured depth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.surface_depth import SAME_SURFACE, drawn_surfaces, surface_depth

# Below this coverage, the color of a pixel is meaningless.
LEAST_ALPHA = 1e-3


@dataclass(frozen=True, eq=False)
class DepthView:
    """One view of the surface.

    Attributes:
        camera: the viewpoint.
        color: sRGB in 0..1 of the Gaussians alone, without background, (height, width, 3), float32.
        depth: planar depth of the surface [m], NaN where the splats cover less than half of the pixel,
            (height, width), float32.
    """

    camera: Camera
    color: np.ndarray
    depth: np.ndarray


def depth_views(
    gaussians: Gaussians,
    cameras: Sequence[Camera],
    center_world: np.ndarray,
    device: str = "cpu",
    is_object: bool = True,
) -> Iterator[DepthView]:
    """Yield the view of each camera; arguments as of `drawn_surfaces`."""
    on_device = DeviceGaussians.from_numpy(gaussians, device)
    drawn = drawn_surfaces(on_device, cameras, center_world, is_object)
    for camera, renderer in zip(cameras, drawn, strict=True):
        alpha = 1.0 - renderer.transmittance.to_numpy()
        color = renderer.image.to_numpy() / np.maximum(alpha, LEAST_ALPHA)
        depth = surface_depth(renderer.depth.to_numpy())
        yield DepthView(camera, np.clip(color, 0.0, 1.0), depth)


# How far, where the measured depth is trusted entirely: more than half, because the noise of its pixels
# averages out over the views and the errors of Gaussians do not; not all, because these are smooth.
MOST_SHARE = 0.7


def toward_measured(view: DepthView, measured: np.ndarray, trust: float) -> DepthView:
    """Return a view whose depth lies between the rendered and the measured one.

    Args:
        view: of the Gaussians.
        measured: depth of the same pixels [m], NaN where unknown, (height, width).
        trust: in the measured depth, 0 to 1.
    """
    apart = measured - view.depth
    with np.errstate(invalid="ignore"):
        is_same = np.abs(apart) <= SAME_SURFACE * view.depth
    depth = np.where(is_same, view.depth + trust * MOST_SHARE * apart, view.depth)
    return DepthView(view.camera, view.color, depth.astype(np.float32))
