"""What lies behind the splats: tiles of nothing else, and an image.

An image is added after compositing, so that the hot kernels know one color only.
"""

from collections.abc import Sequence

import numpy as np
import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.rigid import PixelBox
from digs_warp.splat.config import TILE_SIZE
from digs_warp.splat.footprint import ViewParams
from digs_warp.splat.records import Planes, ViewPlanes

wp.set_module_options({"enable_backward": False})

_TILE = wp.constant(TILE_SIZE)

# Tiles around content and splats that are filled with the background: a loss with windows looks there, too.
# That of training reads one tile, the rest of a block of 64 px and 5 px more.
FILLED_AROUND = 5


def tiles_with_background(boxes: Sequence[PixelBox] | None, columns: int, rows: int) -> np.ndarray:
    """Return the tile columns first .. end and rows first .. end that show the background, (4,) int32.

    Args:
        boxes: pixels that are looked at; those around are, too. None: the whole image.
        columns: of tiles in the image.
        rows: of tiles in the image.
    """
    if boxes is None:
        return np.array([0, columns, 0, rows], dtype=np.int32)
    found = np.array(boxes)
    found = found[(found[:, 0] < found[:, 2]) & (found[:, 1] < found[:, 3])]
    if not len(found):
        return np.zeros(4, dtype=np.int32)
    x0, y0 = found[:, :2].min(axis=0) // TILE_SIZE - FILLED_AROUND
    x1, y1 = -(-found[:, 2:].max(axis=0) // TILE_SIZE) + FILLED_AROUND
    return np.array([x0, x1, y0, y1], dtype=np.int32)


@wp.kernel
def add_background_kernel(
    first: int,
    views: wp.array[ViewParams],
    background: wp.array[float],  # 3 padded planes in the layout of the view
    drawn: Planes,
):
    """Add what shines through to one row of the drawn tiles: image += T background."""
    y = first + wp.tid()
    if y < views[0].first_row * _TILE or y >= wp.min(views[0].end_row * _TILE, views[0].height):
        return
    start = drawn.origin + y * drawn.pitch
    for x in range(
        views[0].first_column * _TILE, wp.min(views[0].end_column * _TILE, views[0].width)
    ):
        for channel in range(3):
            p = start + channel * drawn.plane + x
            drawn.image[p] = drawn.image[p] + drawn.transmittance[start + x] * background[p]


def add_background(
    behind: ImagePlanes, drawn: ViewPlanes, views: wp.array, device: str, threads: int
) -> None:
    """Add an image to what was drawn over black, where it shines through.

    Args:
        behind: sRGB, of the size of the renderer.
        drawn: the view.
        views: its parameters, one `ViewParams`.
        device: Warp device of all arrays.
        threads: CPU threads; 0 means all cores.

    Raises:
        ValueError: the image has another size.
    """
    image = drawn.image
    if (behind.pitch, behind.plane, behind.channels) != (image.pitch, image.plane, 3):
        raise ValueError(
            f"background of {behind.max_width}x{behind.max_height} px with {behind.channels} "
            f"channels, renderer of {image.max_width}x{image.max_height} px and 3 channels"
        )
    inputs = [views, behind.data, drawn.for_kernels()]
    launch_parallel(add_background_kernel, image.max_height, inputs, device, threads)
