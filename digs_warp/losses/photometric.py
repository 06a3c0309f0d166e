"""The photometric loss of the paper (section 3.4): L = (1 - lambda) L1 + lambda D-SSIM, over a background.

L1 and D-SSIM = 1 - SSIM are means over all pixels and channels. If pixels have weights, each pixel's term
is multiplied by its weight before the mean over all pixels is taken. The target is composited over the
background of the step, so the mask also supervises the area outside the object: a Gaussian that hides the
background is penalized.
"""

import numpy as np
import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch, put
from digs_warp.measure.ssim import BLOCK_COLUMNS, BLOCK_ROWS, SEGMENT_ROWS, similarity_kernel

# lambda of the 3DGS reference.
DSSIM_WEIGHT = 0.2

# Positions of the arguments that change from view to view.
_LAYOUT, _WEIGHTED, _L1_WEIGHT, _DSSIM_WEIGHT = 0, 4, 6, 7


class PhotometricLoss:
    """L1 + D-SSIM between a rendered image and a target, with its gradient.

    Args:
        image: the rendered planes (3 channels), values in 0..1.
        target: planes of the same layout; zero outside the current size.
        weights: one plane of the same layout; `run` reads it only if ``weighted``.
        adj_image: where the gradient dL/dimage goes, same layout as ``image``.
        dssim_weight: lambda, in 0..1.
        threads: CPU threads; 0 means all cores.

    Attributes:
        sums: the array that `value` sums, on the device.
    """

    def __init__(
        self,
        image: ImagePlanes,
        target: ImagePlanes,
        weights: ImagePlanes,
        adj_image: ImagePlanes,
        dssim_weight: float = DSSIM_WEIGHT,
        threads: int = 0,
    ) -> None:
        device = str(image.data.device)
        width, height = image.max_width, image.max_height
        self.dssim_weight = dssim_weight
        blocks_x, blocks_y = -(-width // BLOCK_COLUMNS), -(-height // BLOCK_ROWS)
        strips = 3 * blocks_x * -(-height // SEGMENT_ROWS)
        self._active = wp.zeros((blocks_y, blocks_x), dtype=int, device=device)
        self.sums = wp.zeros((strips, 2), dtype=float, device=device)
        self._layout = image.layout()
        read = [image.data, target.data, 0, weights.data]
        self._similarity = ParallelLaunch(
            similarity_kernel,
            strips,
            [self._layout, self._active, *read, 0.0, 0.0, adj_image.data, self.sums],
            device,
            threads,
        )
        self._resize(width, height)

    def run(
        self,
        size: tuple[int, int],
        blocks: np.ndarray,
        weighted: bool = False,
    ) -> None:
        """Compute the loss and its gradient.

        Args:
            size: width and height of the current view [px], at most those of the planes.
            blocks: where image and target may differ or the gradient is needed, from `loss_blocks`.
            weighted: whether to weight the pixels by ``weights``.
        """
        if size != self._size:
            self._resize(*size)
        self._similarity.set_param(_WEIGHTED, int(weighted))
        active = np.zeros(self._active.shape, dtype=np.int32)
        active[: blocks.shape[0], : blocks.shape[1]] = blocks
        put(self._active, active)
        self._similarity.run()

    def value(self) -> tuple[float, float, float]:
        """Return (loss, L1, D-SSIM) of the last `run`; waits for the device."""
        l1, dssim = self.sums.numpy().sum(axis=0, dtype=np.float64) / self._count
        return (
            float((1 - self.dssim_weight) * l1 + self.dssim_weight * dssim),
            float(l1),
            float(dssim),
        )

    def _resize(self, width: int, height: int) -> None:
        self._size = width, height
        self._count = 3 * width * height
        self._layout.width, self._layout.height = width, height
        self._similarity.set_param(_LAYOUT, self._layout)
        self._similarity.set_param(_L1_WEIGHT, (1.0 - self.dssim_weight) / self._count)
        self._similarity.set_param(_DSSIM_WEIGHT, self.dssim_weight / self._count)
