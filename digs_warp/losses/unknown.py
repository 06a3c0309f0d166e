"""Pixels that no term may judge: something else may hide the object there.

The target of such a pixel is the rendered image itself: the difference is 0. SSIM compares windows, which
reach over from known pixels, so their gradient is erased.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportIndexIssue=false, reportOperatorIssue=false

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch

wp.set_module_options({"enable_backward": False})

# Positions in the inputs of the kernel.
_STARTS, _COLUMNS, _FROM, _TO = 0, 1, 5, 6


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
def take_kernel(
    row: int,
    starts: wp.array[int],  # [height + 1]
    columns: wp.array[int],
    pitch: int,
    plane: int,
    origin: int,
    source: wp.array[float],  # 3 padded planes; empty: zeros
    # outputs
    target: wp.array[float],  # 3 padded planes
):
    """Take the pixels of one row of the target from the source."""
    y = row + wp.tid()
    if y + 1 >= starts.shape[0]:
        return
    for i in range(starts[y], starts[y + 1]):
        for channel in range(3):
            pixel = origin + y * pitch + columns[i] + channel * plane
            value = float(0.0)
            if source.shape[0] > 0:
                value = source[pixel]
            target[pixel] = value


class LeftOut:
    """Keeps the terms of a step from judging unknown pixels.

    Args:
        image: the rendered planes (3 channels).
        target: planes of the same layout as ``image``.
        adj_image: the gradient with respect to ``image``, same layout.
    """

    def __init__(self, image: ImagePlanes, target: ImagePlanes, adj_image: ImagePlanes) -> None:
        device = str(image.data.device)
        none = [wp.zeros(1, dtype=int, device=device), wp.zeros(1, dtype=int, device=device)]
        given = [*none, image.pitch, image.plane, image.origin, image.data, target.data]
        self._launch = ParallelLaunch(take_kernel, image.max_height, given, device)
        nothing = wp.zeros(0, dtype=float, device=device)
        self._accepted, self._erased = (image.data, target.data), (nothing, adj_image.data)

    def accept(self, pixels: UnknownPixels) -> None:
        """Take what is rendered for the target; call it between target and terms."""
        self._run(pixels, *self._accepted)

    def erase(self, pixels: UnknownPixels) -> None:
        """Erase the gradient; call it after the terms."""
        self._run(pixels, *self._erased)

    def _run(self, pixels: UnknownPixels, source: wp.array, target: wp.array) -> None:
        places = (
            (_STARTS, pixels.starts),
            (_COLUMNS, pixels.columns),
            (_FROM, source),
            (_TO, target),
        )
        for place, value in places:
            self._launch.set_param(place, value)
        self._launch.run()
