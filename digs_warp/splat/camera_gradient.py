"""The gradient of a view's camera: each Gaussian's share in it, and their sum in a fixed order."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.device.parallel import launch_parallel
from digs_warp.splat.project_adjoint import CAMERA_FIELDS

wp.set_module_options({"enable_backward": False})

# Gaussians whose shares one thread sums.
SUM_BLOCK = 1024

_CAMERA_FIELDS = wp.constant(CAMERA_FIELDS)
_SUM_BLOCK = wp.constant(SUM_BLOCK)


@dataclass(frozen=True, eq=False)
class CameraGradient:
    """dL / d(camera) of one view; the camera moves in its own frame, see `digs_warp.splat.project_adjoint`.

    Attributes:
        rotation: in the rotation vector w [rad], shape (3,).
        translation: in the translation t [m], shape (3,): world_from_cam' = world_from_cam exp(w, t).
        focal: in (fx, fy) [px], shape (2,).
        center: in (cx, cy) [px], shape (2,).
    """

    rotation: np.ndarray
    translation: np.ndarray
    focal: np.ndarray
    center: np.ndarray


class CameraShares:
    """Room for the shares of ``count`` Gaussians; of none, when no gradient of the camera is wanted.

    Attributes:
        array: the shares, (count, CAMERA_FIELDS), as `project_backward_kernel` writes them.
    """

    def __init__(self, count: int, device: str, threads: int) -> None:
        self.array = wp.zeros((count, CAMERA_FIELDS), dtype=float, device=device)
        self._threads = threads
        blocks = -(-count // SUM_BLOCK)
        self._sums = wp.zeros((blocks, CAMERA_FIELDS), dtype=wp.float64, device=device)

    def total(self) -> CameraGradient:
        """Return the sum; zero for no Gaussians."""
        count, device = self.array.shape[0], str(self.array.device)
        inputs = [count, self.array, self._sums]
        launch_parallel(sum_camera_kernel, self._sums.shape[0], inputs, device, self._threads)
        total = self._sums.numpy().sum(axis=0)
        return CameraGradient(total[:3], total[3:6], total[6:8], total[8:10])


@wp.kernel
def sum_camera_kernel(
    first: int,
    count: int,
    camera_shares: wp.array2d[float],  # [count, CAMERA_FIELDS]
    # outputs
    block_sums: wp.array2d[wp.float64],  # [blocks, CAMERA_FIELDS]
):
    """Sum the shares of a block of Gaussians in the order of their index."""
    block = first + wp.tid()
    begin = block * _SUM_BLOCK
    for field in range(_CAMERA_FIELDS):
        total = wp.float64(0.0)
        for g in range(begin, wp.min(begin + _SUM_BLOCK, count)):
            total += wp.float64(camera_shares[g, field])
        block_sums[block, field] = total
