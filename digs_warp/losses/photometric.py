"""The photometric loss of the paper (section 3.4): L = (1 - lambda) L1 + lambda D-SSIM, over a background.

L1 and D-SSIM = 1 - SSIM are means over all pixels and channels. The target is composited over the background
of the step, so the mask also supervises the area outside the object: a Gaussian that hides the background is
penalized.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch, packed, put
from digs_warp.measure.ssim import (
    BLOCK_COLUMNS,
    BLOCK_ROWS,
    SEGMENT_ROWS,
    Terms,
    similarity_kernel,
)
from digs_warp.measure.ssim_pixels import similarity_of_pixels

# lambda of the 3DGS reference.
DSSIM_WEIGHT = 0.2


def similarity_of_strips(
    terms: Any, active: wp.array, image: ImagePlanes, target: ImagePlanes, adj_image: ImagePlanes
) -> tuple[list[ParallelLaunch], wp.array]:
    """Record `similarity_kernel`, for CPUs.

    Args:
        terms: `Terms`, the first input of each launch.
        active: the blocks that count, (blocks_y, blocks_x).
        image: three planes, as the next two.
        target: what it is compared with.
        adj_image: where the gradient goes.

    Returns:
        The launches, and sums of |x - y| and of 1 - SSIM over parts of the image, (n, 2).
    """
    device = str(image.data.device)
    strips = 3 * active.shape[1] * -(-image.max_height // SEGMENT_ROWS)
    sums = wp.zeros((strips, 2), dtype=float, device=device)
    inputs = [terms, active, image.data, target.data, adj_image.data, sums]
    return [ParallelLaunch(similarity_kernel, strips, inputs, device)], sums


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
        similarity: Callable[..., tuple[list[ParallelLaunch], wp.array]] | None = None,
    ) -> None:
        device = str(image.data.device)
        width, height = image.max_width, image.max_height
        blocks_x, blocks_y = -(-width // BLOCK_COLUMNS), -(-height // BLOCK_ROWS)
        self._active = wp.zeros((blocks_y, blocks_x), dtype=int, device=device)
        sizes = {"columns": width, "rows": height, "size": 3 * image.plane}
        self._terms = packed(Terms, layout=image.layout(), **sizes)
        usual = similarity_of_strips if device == "cpu" else similarity_of_pixels
        given = self._terms, self._active, image, target, adj_image
        self._launches, self.sums = (similarity or usual)(*given)
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
        for launch in self._launches:
            launch.run()

    def value(self) -> float:
        """Return the loss of the last `run`; waits for the device."""
        l1, dssim = self.sums.numpy().sum(axis=0, dtype=np.float64) / self._count
        return float((1 - DSSIM_WEIGHT) * l1 + DSSIM_WEIGHT * dssim)

    def _resize(self, width: int, height: int) -> None:
        self._size = width, height
        self._count = 3 * width * height
        terms = self._terms
        terms.layout.width, terms.layout.height = width, height
        terms.l1_weight = (1.0 - DSSIM_WEIGHT) / self._count
        terms.dssim_weight = DSSIM_WEIGHT / self._count
        for launch in self._launches:
            launch.set_param(0, terms)
