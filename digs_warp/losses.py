"""The training loss of the paper (section 3.4): L = (1 - lambda) L1 + lambda D-SSIM, over a background.

L1 and D-SSIM = 1 - SSIM are means over all pixels and channels. The target is composited over the
background of the step, so that the mask supervises the outside of the object, too: a Gaussian that covers
background is wrong wherever the background shows through differently.
"""

import numpy as np
import warp as wp

from digs_warp.checks import check_shape
from digs_warp.compose import compose_kernel
from digs_warp.image_planes import ImagePlanes
from digs_warp.parallel import ParallelLaunch
from digs_warp.ssim import (
    BLOCK_COLUMNS,
    BLOCK_ROWS,
    REACH,
    similarity_gradient_kernel,
    similarity_kernel,
)

# lambda of the 3DGS reference.
DSSIM_WEIGHT = 0.2


Box = tuple[int, int, int, int]
"""Pixels x0 <= x < x1, y0 <= y < y1 as (x0, y0, x1, y1); empty when x0 >= x1 or y0 >= y1."""


def pack_view(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the planes red, green, blue, mask of a view in one flat uint8 array."""
    height, width = mask.shape
    check_shape("image", image, (height, width, 3))
    planes = np.concatenate([image.transpose(2, 0, 1).reshape(3, -1), mask.reshape(1, -1)])
    return np.ascontiguousarray(planes, dtype=np.uint8).reshape(-1)


class PhotometricLoss:
    """L1 + D-SSIM between a rendered image and a composited target, with its gradient.

    Args:
        image: the rendered planes (3 channels), values in 0..1.
        adj_image: where the gradient dL/dimage goes, same layout.
        dssim_weight: lambda, in 0..1.
        threads: CPU threads; 0 means all cores.
    """

    def __init__(
        self,
        image: ImagePlanes,
        adj_image: ImagePlanes,
        dssim_weight: float = DSSIM_WEIGHT,
        threads: int = 0,
    ) -> None:
        device = str(image.data.device)
        width, height = image.width, image.height
        self.dssim_weight = dssim_weight
        self._count = 3 * width * height
        self._size = (width, height)
        self.target = ImagePlanes(width, height, 3, device)
        self._background = wp.zeros(3, dtype=float, device=device)
        self._loss_region = wp.zeros(4, dtype=int, device=device)
        self._gradient_region = wp.zeros(4, dtype=int, device=device)
        maps = ImagePlanes(width, height, 9, device)
        blocks_x, blocks_y = -(-width // BLOCK_COLUMNS), -(-height // BLOCK_ROWS)
        blocks = 3 * blocks_x * blocks_y
        self._sums = wp.zeros((blocks, 2), dtype=float, device=device)
        self._device = device
        self._threads = threads
        shape = [blocks_x, blocks_y, width, height, image.pitch, image.plane, image.origin]
        pair = [image.data, self.target.data, maps.data]
        weights = [(1.0 - dssim_weight) / self._count, dssim_weight / self._count]
        self._similarity = ParallelLaunch(
            similarity_kernel,
            blocks,
            [*shape, self._loss_region, *pair, self._sums],
            device,
            threads,
        )
        self._gradient = ParallelLaunch(
            similarity_gradient_kernel,
            blocks,
            [*shape, self._gradient_region, *pair, *weights, adj_image.data],
            device,
            threads,
        )

    def set_target(self, pixels: wp.array, background: np.ndarray) -> None:
        """Composite a view, packed by `pack_view`, over an sRGB background colour (3,)."""
        self._background.assign(np.asarray(background, dtype=np.float32))
        width, height = self._size
        target = self.target
        layout = [width, target.pitch, target.plane, target.origin]
        ParallelLaunch(
            compose_kernel,
            height,
            [*layout, pixels, width * height, self._background, target.data],
            self._device,
            self._threads,
        ).run()

    def run(self, content: Box, drawn: Box) -> None:
        """Compute the loss and its gradient.

        Args:
            content: a box outside of which image and target both show the background.
            drawn: the box inside which the gradient is wanted (where splats are).
        """
        width, height = self._size
        # SSIM differs from 1 up to one window around the content, and the gradient reads one more.
        margin = 2 * REACH
        x0, y0, x1, y1 = union(content, drawn)
        grown = (
            max(x0 - margin, 0),
            max(y0 - margin, 0),
            min(x1 + margin, width),
            min(y1 + margin, height),
        )
        self._loss_region.assign(np.array(grown, dtype=np.int32))
        self._gradient_region.assign(np.array(drawn, dtype=np.int32))
        self._similarity.run()
        self._gradient.run()

    def value(self) -> tuple[float, float, float]:
        """Return (loss, L1, D-SSIM) of the last `run`; waits for the device."""
        l1, dssim = self._sums.numpy().sum(axis=0, dtype=np.float64) / self._count
        return (
            float((1 - self.dssim_weight) * l1 + self.dssim_weight * dssim),
            float(l1),
            float(dssim),
        )


def union(a: Box, b: Box) -> Box:
    """Return the smallest box around two boxes; an empty one does not count."""
    if a[0] >= a[2] or a[1] >= a[3]:
        return b
    if b[0] >= b[2] or b[1] >= b[3]:
        return a
    return min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])


def mask_box(mask: np.ndarray) -> Box:
    """Return the box of the pixels above 0, (0, 0, 0, 0) when there is none."""
    ys, xs = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(xs):
        return 0, 0, 0, 0
    return int(xs[0]), int(ys[0]), int(xs[-1]) + 1, int(ys[-1]) + 1
