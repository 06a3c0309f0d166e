"""Gaussians, and what density control sums of them, as Warp arrays: what the kernels read and write."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from digs_warp.checks import check_finite
from digs_warp.data.gaussians import FIELDS, NO_FILTER, Gaussians, ScreenFilter
from digs_warp.device.parallel import packed
from digs_warp.device.warp_start import require_device
from digs_warp.geometry.rigid import quat_multiply, quat_xyzw_from_matrix, transform_points
from digs_warp.splat.records import GaussianArrays, StatisticsArrays


@dataclass(frozen=True, eq=False)
class SplatStatistics:
    """Sums over the backward passes of a renderer whose ``statistics`` this is.

    Attributes:
        gradient_sums: norm of dL/d(center on the image), in units of half the image size (normalized device
            coordinates, as 3DGS sums it), shape (n,).
        counts: in how many views the Gaussian was drawn, shape (n,).
    """

    gradient_sums: wp.array
    counts: wp.array

    @staticmethod
    def zeros(count: int, device: str = "cpu") -> "SplatStatistics":
        """Return statistics of no view for ``count`` Gaussians."""
        return SplatStatistics(*(wp.zeros(count, dtype=float, device=device) for _ in range(2)))

    def for_kernels(self) -> Any:
        """Return the arrays as kernels take them, `StatisticsArrays`."""
        return packed(StatisticsArrays, **vars(self))


@dataclass
class DeviceGaussians:
    """Raw parameters of `digs_warp.data.gaussians.Gaussians` on a device; also used for their gradients."""

    means: wp.array  # [n] vec3
    log_scales: wp.array  # [n] vec3
    quats: wp.array  # [n] vec4, xyzw
    opacity_logits: wp.array  # [n]
    sh: wp.array  # [n, K] vec3
    screen_filter: ScreenFilter = NO_FILTER

    def __len__(self) -> int:
        return self.means.shape[0]

    @property
    def arrays(self) -> tuple[wp.array, wp.array, wp.array, wp.array, wp.array]:
        """All five, in the order of the fields."""
        return self.means, self.log_scales, self.quats, self.opacity_logits, self.sh

    @property
    def device(self) -> str:
        """The Warp device they live on."""
        return str(self.means.device)

    def for_kernels(self) -> Any:
        """Return the arrays as kernels take them, `GaussianArrays`."""
        return packed(GaussianArrays, **dict(zip(FIELDS, self.arrays, strict=True)))

    @staticmethod
    def from_numpy(gaussians: Gaussians, device: str = "cpu") -> "DeviceGaussians":
        """Copy Gaussians to a device.

        Raises:
            DigsError: a value is NaN or infinite, or there is no such device.
        """
        require_device(device)
        for name in FIELDS:
            check_finite(f"Gaussians.{name}", getattr(gaussians, name))

        def put(value: np.ndarray, dtype: type) -> wp.array:
            return wp.array(value, dtype=dtype, device=device)

        return DeviceGaussians(
            put(gaussians.means, wp.vec3),
            put(gaussians.log_scales, wp.vec3),
            put(gaussians.quats, wp.vec4),
            put(gaussians.opacity_logits, wp.float32),
            put(gaussians.sh, wp.vec3),
            gaussians.screen_filter,
        )

    def to_numpy(self) -> Gaussians:
        """Return a copy on the host."""
        host = (array.numpy().copy() for array in self.arrays)
        return Gaussians(*host, screen_filter=self.screen_filter)

    def zeros_like(self) -> "DeviceGaussians":
        """Return the same arrays, filled with zeros."""
        return DeviceGaussians(*map(wp.zeros_like, self.arrays), screen_filter=self.screen_filter)


def move_gaussians(gaussians: DeviceGaussians, motion: np.ndarray) -> None:
    """Move centers and axes by a rigid motion of the world, (4, 4); colors by direction stay."""
    turn = quat_xyzw_from_matrix(motion[:3, :3])
    means = transform_points(motion, gaussians.means.numpy().astype(np.float64))
    quats = quat_multiply(turn, gaussians.quats.numpy())
    gaussians.means.assign(means.astype(np.float32))
    gaussians.quats.assign(quats.astype(np.float32))
