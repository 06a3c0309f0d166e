"""Pixels that no term may judge: something else may hide the object there.

The target of such a pixel is the rendered image itself: the difference is 0. SSIM compares windows, which
reach over from known pixels, so their gradient is erased.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportIndexIssue=false, reportOperatorIssue=false
# pyright: reportGeneralTypeIssues=false

import numpy as np
import warp as wp

from digs_warp.device.image_planes import ImagePlanes, PlaneLayout
from digs_warp.device.parallel import launch_parallel

wp.set_module_options({"enable_backward": False})


def unknown_pixels(unknown: np.ndarray | None, device: str = "cpu") -> wp.array | None:
    """Return columns and rows of the true pixels of a (height, width) bool mask; None: there are none."""
    if unknown is None or not unknown.any():
        return None
    return wp.array(np.argwhere(unknown)[:, ::-1].astype(np.int32), dtype=wp.vec2i, device=device)


@wp.kernel
def take_kernel(
    first: int,
    pixels: wp.array[wp.vec2i],
    layout: PlaneLayout,
    source: wp.array[float],  # 3 padded planes
    share: float,
    # outputs
    target: wp.array[float],  # 3 padded planes
):
    """Take a pixel of the target from the source, times a share."""
    pixel = pixels[first + wp.tid()]
    at = layout.origin + pixel[1] * layout.pitch + pixel[0]
    for channel in range(3):
        p = at + channel * layout.plane
        target[p] = share * source[p]


def accept(pixels: wp.array, image: ImagePlanes, target: ImagePlanes) -> None:
    """Take what is rendered for the target; call it between target and terms."""
    inputs = [pixels, image.layout(), image.data, 1.0, target.data]
    launch_parallel(take_kernel, len(pixels), inputs, str(pixels.device))


def erase(pixels: wp.array, adj_image: ImagePlanes) -> None:
    """Erase the gradient with respect to the image; call it after the terms."""
    inputs = [pixels, adj_image.layout(), adj_image.data, 0.0, adj_image.data]
    launch_parallel(take_kernel, len(pixels), inputs, str(pixels.device))
