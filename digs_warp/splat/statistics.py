"""What density control wants to know of each Gaussian, summed over the views since the last reset."""

from dataclasses import dataclass
from typing import Any

import warp as wp

from digs_warp.device.parallel import packed
from digs_warp.splat.records import StatisticsArrays


@dataclass(frozen=True, eq=False)
class SplatStatistics:
    """Sums over the backward passes of a renderer whose ``statistics`` this is.

    Attributes:
        gradient_sums: norm of dL/d(center on the image), in units of half the image size (normalized device
            coordinates, as 3DGS sums it), shape (n,).
        absolute_sums: the same of the sums over pixels of the absolute values (AbsGS), shape (n,); empty
            when not wanted.
        counts: in how many views the Gaussian was drawn, shape (n,).
        max_radii: largest radius on the image [px], three standard deviations of the longer axis, (n,).
    """

    gradient_sums: wp.array
    absolute_sums: wp.array
    counts: wp.array
    max_radii: wp.array

    @staticmethod
    def zeros(count: int, device: str = "cpu", *, absolute: bool = False) -> "SplatStatistics":
        """Return statistics of no view for ``count`` Gaussians."""

        def empty(length: int) -> wp.array:
            return wp.zeros(length, dtype=float, device=device)

        return SplatStatistics(
            empty(count), empty(count if absolute else 0), empty(count), empty(count)
        )

    @property
    def has_absolute(self) -> bool:
        """Whether absolute gradients are summed, too: the backward pass then takes longer."""
        return self.absolute_sums.shape[0] > 0

    def for_kernels(self) -> Any:
        """Return the arrays as kernels take them, `StatisticsArrays`."""
        return packed(StatisticsArrays, **vars(self))

    def reset(self) -> None:
        """Forget all views."""
        for array in vars(self).values():
            array.zero_()
