# type: ignore
# (device code, which Warp's stubs do not type)
"""An image behind the splats: added after compositing, so that the hot kernels know one colour only."""

import warp as wp

from digs_warp.splat.config import TILE_SIZE
from digs_warp.splat.footprint import ViewParams

wp.set_module_options({"enable_backward": False})

_TILE = wp.constant(TILE_SIZE)


@wp.kernel
def add_background_kernel(
    first: int,
    views: wp.array[ViewParams],
    pitch: int,
    plane: int,
    origin: int,
    transmittance: wp.array[float],
    background: wp.array[float],  # 3 padded planes in the layout of the image
    # outputs
    image: wp.array[float],
):
    """Add what shines through to one row of the drawn tiles: image += T background."""
    y = first + wp.tid()
    if y < views[0].first_row * _TILE or y >= wp.min(views[0].end_row * _TILE, views[0].height):
        return
    start = origin + y * pitch
    for x in range(
        views[0].first_column * _TILE, wp.min(views[0].end_column * _TILE, views[0].width)
    ):
        for channel in range(3):
            p = start + channel * plane + x
            image[p] = image[p] + transmittance[start + x] * background[p]
