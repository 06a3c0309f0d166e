"""Pixels that no term may judge: something else may hide the object there.

The target of such a pixel is the rendered image itself, and that of the coverage the rendered alpha: both
differences are 0. SSIM compares windows, which reach over from known pixels, so their gradient is erased.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportIndexIssue=false, reportOperatorIssue=false

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch

wp.set_module_options({"enable_backward": False})

# Positions in the inputs of both kernels.
_STARTS, _COLUMNS = 0, 1


@dataclass(frozen=True, eq=False)
class UnknownPixels:
    """The pixels row by row, on the device.

    Attributes:
        starts: index of the first pixel of each row in ``columns``, and their number, (height + 1,), int32.
        columns: (n,), int32.
    """

    starts: wp.array
    columns: wp.array

    @staticmethod
    def of(unknown: np.ndarray | None, device: str = "cpu") -> "UnknownPixels | None":
        """Return the true pixels of a (height, width) bool mask; None: there are none."""
        if unknown is None or not unknown.any():
            return None
        rows, columns = np.nonzero(unknown)
        starts = np.searchsorted(rows, np.arange(len(unknown) + 1))
        return UnknownPixels(
            wp.array(starts.astype(np.int32), dtype=int, device=device),
            wp.array(columns.astype(np.int32), dtype=int, device=device),
        )

    @property
    def bytes(self) -> int:
        """Memory [bytes]."""
        return 4 * (self.starts.size + self.columns.size)


@wp.kernel
def accept_kernel(
    row: int,
    starts: wp.array[int],  # [height + 1]
    columns: wp.array[int],
    pitch: int,
    plane: int,
    origin: int,
    image: wp.array[float],  # 3 padded planes
    transmittance: wp.array[float],  # 1 padded plane
    # outputs
    target: wp.array[float],  # 3 padded planes
    mask: wp.array[float],  # 1 padded plane
):
    """Take what is rendered in one row for the target."""
    y = row + wp.tid()
    if y + 1 >= starts.shape[0]:
        return
    for i in range(starts[y], starts[y + 1]):
        pixel = origin + y * pitch + columns[i]
        mask[pixel] = 1.0 - transmittance[pixel]
        for channel in range(3):
            target[pixel + channel * plane] = image[pixel + channel * plane]


@wp.kernel
def erase_kernel(
    row: int,
    starts: wp.array[int],  # [height + 1]
    columns: wp.array[int],
    pitch: int,
    plane: int,
    origin: int,
    # outputs
    adj_image: wp.array[float],  # 3 padded planes
):
    """Set the gradient in one row to 0."""
    y = row + wp.tid()
    if y + 1 >= starts.shape[0]:
        return
    for i in range(starts[y], starts[y + 1]):
        for channel in range(3):
            adj_image[origin + y * pitch + columns[i] + channel * plane] = 0.0


class LeftOut:
    """Keeps the terms of a step from judging unknown pixels.

    Args:
        image: the rendered planes (3 channels).
        transmittance: how much of the background is visible, as rendered, one plane.
        target: planes of the same layout as ``image``.
        mask: the mask of the current view, one plane.
        adj_image: the gradient with respect to ``image``, same layout.
    """

    def __init__(
        self,
        image: ImagePlanes,
        transmittance: ImagePlanes,
        target: ImagePlanes,
        mask: ImagePlanes,
        adj_image: ImagePlanes,
    ) -> None:
        device = str(image.data.device)
        none = [wp.zeros(1, dtype=int, device=device), wp.zeros(1, dtype=int, device=device)]
        layout = [image.pitch, image.plane, image.origin]
        drawn = [image.data, transmittance.data]
        rows = image.max_height
        accepted, erased = [*drawn, target.data, mask.data], [adj_image.data]
        self._accept = ParallelLaunch(accept_kernel, rows, [*none, *layout, *accepted], device)
        self._erase = ParallelLaunch(erase_kernel, rows, [*none, *layout, *erased], device)

    def accept(self, pixels: UnknownPixels) -> None:
        """Take what is rendered for the target; call it between target and terms."""
        self._run(self._accept, pixels)

    def erase(self, pixels: UnknownPixels) -> None:
        """Erase the gradient; call it after the terms."""
        self._run(self._erase, pixels)

    def _run(self, launch: ParallelLaunch, pixels: UnknownPixels) -> None:
        launch.set_param(_STARTS, pixels.starts)
        launch.set_param(_COLUMNS, pixels.columns)
        launch.run()
