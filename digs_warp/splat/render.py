"""One picture of Gaussians: NumPy values in, NumPy values out; and its gradients the same way."""

from dataclasses import dataclass, field

import numpy as np

from digs_warp.checks import DigsError, check_finite, check_shape
from digs_warp.data.gaussians import Gaussians
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.geometry.camera import Camera
from digs_warp.splat.camera_motion import RowMotion
from digs_warp.splat.config import DEFAULT_OPTIONS, EXPECTED, MEDIAN, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.renderer import WHITE, SplatRenderer

__all__ = ["RenderOutput", "SplatRenderer", "near_plane", "render"]


@dataclass(frozen=True, eq=False)
class RenderOutput:
    """One rendered view. It keeps the renderer's buffers, for `backward`, as long as it lives.

    Attributes:
        image: sRGB, shape (height, width, 3), float32, not clipped above.
        alpha: coverage in 0..1, shape (height, width), float32.
        depth: expected planar depth [m], shape (height, width), NaN where nothing is drawn; None unless
            the options ask for it, as the next one.
        median_depth: planar depth [m] at which the coverage passes 1/2, NaN where it does not, same shape.
    """

    image: np.ndarray
    alpha: np.ndarray
    depth: np.ndarray | None
    median_depth: np.ndarray | None
    _renderer: SplatRenderer = field(repr=False)

    def backward(
        self,
        *,
        adj_image: np.ndarray | None = None,
        adj_alpha: np.ndarray | None = None,
        adj_depth: np.ndarray | None = None,
    ) -> Gaussians:
        """Return the gradients of a loss L in the parameters of the Gaussians, in their shapes.

        Args:
            adj_image: dL/d(image), shape (height, width, 3). Default: 0, as for the others.
            adj_alpha: dL/d(alpha), shape (height, width).
            adj_depth: dL/d(depth), shape (height, width); ignored where there is no depth.

        Raises:
            DigsError: a gradient of another shape, not finite, or of an output that was not rendered.
        """
        renderer = self._renderer
        if adj_alpha is not None:
            adj_alpha = -np.asarray(adj_alpha)  # alpha is 1 - transmittance
        if adj_depth is not None and self.depth is not None:
            adj_depth = np.where(np.isnan(self.depth), 0.0, adj_depth)
        for name, output, planes, adjoint in (
            ("image", self.image, renderer.adj_image, adj_image),
            ("alpha", self.alpha, renderer.adj_transmittance, adj_alpha),
            ("depth", self.depth, renderer.adj_depth, adj_depth),
        ):
            _assign_adjoint(f"adj_{name}", output, planes, adjoint)
        renderer.backward()
        return renderer.gradients.to_numpy()


def _assign_adjoint(
    name: str, output: np.ndarray | None, planes: ImagePlanes, adjoint: np.ndarray | None
) -> None:
    if output is None:
        if adjoint is not None:
            raise DigsError(
                f"{name}: the view has no such output; render it with RasterOptions(outputs=...)"
            )
    elif adjoint is None:
        planes.data.zero_()
    else:
        planes.assign(check_finite(name, check_shape(name, np.asarray(adjoint), output.shape)))


def render(
    gaussians: Gaussians,
    camera: Camera,
    *,
    background: tuple[float, float, float] | np.ndarray = WHITE,
    near: float | None = None,
    options: RasterOptions = DEFAULT_OPTIONS,
    device: str = "cpu",
    rows: RowMotion | None = None,
) -> RenderOutput:
    """Render one view; allocates its buffers, so use `SplatRenderer` for many.

        view = render(gaussians, camera)
        gradients = view.backward(adj_image=2 * (view.image - target))

    Args:
        gaussians: what to draw.
        camera: from where.
        background: sRGB color behind the Gaussians, shape (3,).
        near: near plane [m]; default: a share of the distance to the middle of the Gaussians.
        options: how splats are drawn, and whether depth is wanted.
        device: Warp device.
        rows: how the camera moves while the rows are read (rolling shutter); default: it does not.

    Raises:
        DigsError: values that are not finite, or a background that is no color.
    """
    k = camera.intrinsics
    renderer = SplatRenderer(
        DeviceGaussians.from_numpy(gaussians, device),
        *(k.width, k.height),
        options=options,
    )
    if near is None:
        means = renderer.gaussians.means.numpy()
        center = means.mean(axis=0) if len(means) else np.zeros(3)
        near = near_plane(camera, center)
    renderer.forward(camera, near=near, background=background, rows=rows)
    alpha = 1.0 - renderer.transmittance.to_numpy()[..., 0]
    depth = median = None
    if options.has_depth:
        depths = np.where(renderer.depth.to_numpy() > 0, renderer.depth.to_numpy(), np.nan)
        depth = depths[..., EXPECTED]
        median = depths[..., MEDIAN] if options.depth_channels > MEDIAN else None
    image = renderer.image.to_numpy()
    return RenderOutput(image, alpha, depth, median, renderer)
