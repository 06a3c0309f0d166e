"""One picture of Gaussians: NumPy values in, NumPy values out."""

from dataclasses import dataclass

import numpy as np

from digs_warp.camera import Camera
from digs_warp.checks import check_shape
from digs_warp.data.gaussians import Gaussians
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.splat.config import DEFAULT_OPTIONS, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.renderer import WHITE, SplatRenderer

__all__ = ["RenderOutput", "SplatRenderer", "near_plane", "render"]


@dataclass(frozen=True, eq=False)
class RenderOutput:
    """One rendered view.

    Attributes:
        image: sRGB, shape (height, width, 3), float32, not clipped above.
        alpha: coverage in 0..1, shape (height, width), float32.
        depth: expected planar depth [m], shape (height, width), NaN where nothing is drawn; None unless
            the options ask for it, as the next two.
        median_depth: planar depth [m] at which the coverage passes 1/2, NaN where it does not, alike.
        normals: sum of the weighted unit normals, camera axes, shape (height, width, 3).
    """

    image: np.ndarray
    alpha: np.ndarray
    depth: np.ndarray | None = None
    median_depth: np.ndarray | None = None
    normals: np.ndarray | None = None


def render(
    gaussians: Gaussians,
    camera: Camera,
    *,
    background: tuple[float, float, float] | np.ndarray = WHITE,
    near: float | None = None,
    options: RasterOptions = DEFAULT_OPTIONS,
    device: str = "cpu",
) -> RenderOutput:
    """Render one view; allocates its buffers, so use `SplatRenderer` for many.

    Args:
        gaussians: what to draw.
        camera: from where.
        background: sRGB colour, shape (3,), or image, shape (height, width, 3), behind the Gaussians.
        near: near plane [m]; default: a share of the distance to the middle of the Gaussians.
        options: how splats are drawn, and whether depth and normals are wanted.
        device: Warp device.
    """
    if near is None:
        center = gaussians.means.mean(axis=0) if len(gaussians) else np.zeros(3)
        near = near_plane(camera, center, options.near_share)
    k = camera.intrinsics
    renderer = SplatRenderer(
        DeviceGaussians.from_numpy(gaussians, device), k.width, k.height, options=options
    )
    behind: np.ndarray | ImagePlanes = np.asarray(background, dtype=np.float32)
    if behind.ndim == 3:
        check_shape("background", behind, (k.height, k.width, 3))
        behind = ImagePlanes.of(behind, device)
    renderer.forward(camera, near=near, background=behind)
    alpha = 1.0 - renderer.transmittance.to_numpy()[..., 0]
    depth = median = None
    if options.has_depth:
        depths = np.where(renderer.depth.to_numpy() > 0, renderer.depth.to_numpy(), np.nan)
        depth, median = depths[..., 0], depths[..., 1]
    normals = renderer.normals.to_numpy() if options.has_normals else None
    return RenderOutput(renderer.image.to_numpy(), alpha, depth, median, normals)
