"""The photometric loss of the paper (section 3.4): L = (1 - lambda) L1 + lambda D-SSIM, over a background.

L1 and D-SSIM = 1 - SSIM are means over all pixels and channels. The target is composited over the background
of the step, so the mask also supervises the area outside the object: a Gaussian that hides the background is
penalized.
"""

from typing import Any

import numpy as np
import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch, put
from digs_warp.measure.ssim import BLOCK_COLUMNS, BLOCK_ROWS, SEGMENT_ROWS, similarity_kernel
from digs_warp.measure.ssim_pixels import PixelSimilarity

# lambda of the 3DGS reference.
DSSIM_WEIGHT = 0.2

# Positions of the arguments of `similarity_kernel` that change from view to view.
_LAYOUT, _L1_WEIGHT, _DSSIM_WEIGHT = 0, 4, 5


class StripSimilarity:
    """`similarity_kernel`, for CPUs; arguments and attributes are those of `PixelSimilarity`."""

    def __init__(
        self,
        active: wp.array,
        image: ImagePlanes,
        target: ImagePlanes,
        adj_image: ImagePlanes,
    ) -> None:
        device = str(image.data.device)
        strips = 3 * active.shape[1] * -(-image.max_height // SEGMENT_ROWS)
        self.sums = wp.zeros((strips, 2), dtype=float, device=device)
        self._launch = ParallelLaunch(
            similarity_kernel,
            strips,
            [image.layout(), active, image.data, target.data, 0.0, 0.0, adj_image.data, self.sums],
            device,
        )

    def weigh(self, layout: Any, l1_weight: float, dssim_weight: float) -> None:
        """Set the `PlaneLayout` of the view, and the weights of a pixel's terms."""
        self._launch.set_param(_LAYOUT, layout)
        self._launch.set_param(_L1_WEIGHT, l1_weight)
        self._launch.set_param(_DSSIM_WEIGHT, dssim_weight)

    def run(self) -> None:
        """Compute the gradient and the sums."""
        self._launch.run()


class PhotometricLoss:
    """L1 + D-SSIM between a rendered image and a target, with its gradient.

    Args:
        image: the rendered planes (3 channels), values in 0..1.
        target: planes of the same layout; zero outside the current size.
        adj_image: where the gradient dL/dimage goes, same layout as ``image``.
        similarity: which kernels compute. Default: those for the device.

    Attributes:
        sums: the array that `value` sums, on the device.
    """

    def __init__(
        self,
        image: ImagePlanes,
        target: ImagePlanes,
        adj_image: ImagePlanes,
        similarity: type[StripSimilarity] | type[PixelSimilarity] | None = None,
    ) -> None:
        device = str(image.data.device)
        width, height = image.max_width, image.max_height
        blocks_x, blocks_y = -(-width // BLOCK_COLUMNS), -(-height // BLOCK_ROWS)
        self._active = wp.zeros((blocks_y, blocks_x), dtype=int, device=device)
        self._layout = image.layout()
        chosen = similarity or (StripSimilarity if device == "cpu" else PixelSimilarity)
        self._similarity = chosen(self._active, image, target, adj_image)
        self.sums = self._similarity.sums
        self._resize(width, height)

    def run(self, size: tuple[int, int], blocks: np.ndarray) -> None:
        """Compute the loss and its gradient.

        Args:
            size: width and height of the current view [px], at most those of the planes.
            blocks: where image and target may differ or the gradient is needed, from `loss_blocks`.
        """
        if size != self._size:
            self._resize(*size)
        active = np.zeros(self._active.shape, dtype=np.int32)
        active[: blocks.shape[0], : blocks.shape[1]] = blocks
        put(self._active, active)
        self._similarity.run()

    def value(self) -> float:
        """Return the loss of the last `run`; waits for the device."""
        l1, dssim = self.sums.numpy().sum(axis=0, dtype=np.float64) / self._count
        return float((1 - DSSIM_WEIGHT) * l1 + DSSIM_WEIGHT * dssim)

    def _resize(self, width: int, height: int) -> None:
        self._size = width, height
        self._count = 3 * width * height
        self._layout.width, self._layout.height = width, height
        weights = (1.0 - DSSIM_WEIGHT) / self._count, DSSIM_WEIGHT / self._count
        self._similarity.weigh(self._layout, *weights)
