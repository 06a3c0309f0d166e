"""Alpha supervision: pulls the rendered alpha toward the mask, inside and outside the object.

    L = (1 / pixels) sum |alpha - mask|,   alpha = 1 - transmittance

A random background has the same effect on average; this term acts in every step and with any background.
"""

import numpy as np
import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch
from digs_warp.device.small_arrays import put
from digs_warp.geometry.rigid import PixelBox
from digs_warp.losses.regions import union

wp.set_module_options({"enable_backward": False, "max_unroll": 1, "optimization_level": 3})

_NOT_NEGATIVE = wp.constant(0x7FFFFFFF)
_SLOPE = 5  # position of the slope in the inputs of the kernel


@wp.kernel
def coverage_kernel(
    row: int,
    pitch: int,
    origin: int,
    region: wp.array[int],  # [4] x0, y0, x1, y1
    transmittance: wp.array[float],  # 1 padded plane
    mask: wp.array[float],  # 1 padded plane
    slope: float,  # weight / pixels
    # outputs
    adj_transmittance: wp.array[float],  # 1 padded plane
    sums: wp.array[float],  # [height] sum of |alpha - mask| over a row
):
    """Compare one row and write its gradient."""
    y = row + wp.tid()
    total = float(0.0)
    if y >= region[1] and y < region[3]:
        start = (origin + y * pitch + region[0]) & _NOT_NEGATIVE
        for x in range(region[2] - region[0]):
            excess = 1.0 - transmittance[start + x] - mask[start + x]
            total += wp.abs(excess)
            adj_transmittance[start + x] = wp.where(
                excess > 0.0, -slope, wp.where(excess < 0.0, slope, 0.0)
            )
    sums[y] = total


class CoverageLoss:
    """weight * mean |alpha - mask|, and its gradient with respect to the transmittance.

    Args:
        transmittance: how much of the background is visible, as rendered, one plane.
        mask: the mask of the current view in 0..1, same layout.
        adj_transmittance: where dL/dtransmittance goes, same layout.
        weight: weight of the term.
        threads: CPU threads; 0 means all cores.

    Attributes:
        sums: the array that `value` sums, on the device.
    """

    def __init__(
        self,
        transmittance: ImagePlanes,
        mask: ImagePlanes,
        adj_transmittance: ImagePlanes,
        weight: float,
        threads: int = 0,
    ) -> None:
        device = str(transmittance.data.device)
        self.weight = weight
        self._scale = 0.0
        self._region = wp.zeros(4, dtype=int, device=device)
        self.sums = wp.zeros(transmittance.max_height, dtype=float, device=device)
        layout = [transmittance.pitch, transmittance.origin, self._region]
        self._launch = ParallelLaunch(
            coverage_kernel,
            transmittance.max_height,
            [*layout, transmittance.data, mask.data, 0.0, adj_transmittance.data, self.sums],
            device,
            threads,
        )

    def run(self, size: tuple[int, int], content: PixelBox, drawn: PixelBox) -> None:
        """Compute the term and its gradient; arguments as in `PhotometricLoss.run`."""
        self._scale = self.weight / (size[0] * size[1])
        put(self._region, union(content, drawn))
        self._launch.set_param(_SLOPE, self._scale)
        self._launch.run()

    def value(self) -> float:
        """Return the weighted term of the last `run`; waits for the device."""
        return self._scale * float(self.sums.numpy().sum(dtype=np.float64))
