"""Depth of the left infrared eye in the image of the color camera: every pixel is moved, the nearest wins.

Eyes and color camera look the same way from places on one line, so that rows stay rows: color pixel row v
gets depth from the rows of the eye that it overlaps. Each depth pixel is a square in front of the eye at its
depth; every color pixel that the moved square overlaps takes its depth, as in the vendor's SDK
(rs2::align moves the corners of each pixel, fills the rectangle between them, and keeps the nearest). That
closes the cracks that a larger focal length opens, and makes near things up to a pixel wider. What the eye
does not see stays empty: a shadow beside near things.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import numpy as np
import warp as wp

from digs_warp.checks import check_shape
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.arrays import launch_rows

wp.set_module_options({"enable_backward": False})

# A square that reaches into a pixel by less than this does not count: its place is known to about that [px].
TOUCH = wp.constant(wp.float64(1.0e-6))


@wp.kernel
def _register_kernel(
    first: int,
    depth: wp.array2d[float],  # of the left eye, not finite where unknown
    zoom: wp.float64,  # focal length of the color camera over that of the eye
    shift: wp.float64,  # focal length of the color camera times its offset [px m]
    center_x: wp.float64,  # principal point of both [px]
    center_y: wp.float64,
    # outputs
    nearest: wp.array2d[float],  # depth at each color pixel
    source: wp.array2d[int],  # number of the depth pixel that it comes from; -1: none
):
    """Fill one row of the color camera's grid."""
    row = first + wp.tid()
    height = depth.shape[0]
    width = depth.shape[1]
    for column in range(width):
        nearest[row, column] = wp.inf
        source[row, column] = -1
    top = (wp.float64(row) - center_y) / zoom + center_y
    bottom = (wp.float64(row + 1) - center_y) / zoom + center_y
    from_row = wp.max(int(wp.floor(top + TOUCH)), 0)
    to_row = wp.min(int(wp.ceil(bottom - TOUCH)), height)
    for v in range(from_row, to_row):
        for u in range(width):
            z = depth[v, u]
            if z > 0.0 and wp.isfinite(z):
                left = zoom * (wp.float64(u) - center_x) + center_x - shift / wp.float64(z)
                from_column = wp.max(int(wp.floor(left + TOUCH)), 0)
                to_column = wp.min(int(wp.ceil(left + zoom - TOUCH)), width)
                for column in range(from_column, to_column):
                    if z < nearest[row, column]:
                        nearest[row, column] = z
                        source[row, column] = v * width + u


def sources_of(depth: np.ndarray, rig: StereoRig) -> np.ndarray:
    """Return which pixel of the left eye each pixel of the color camera gets, as a flat index; -1: none.

    Args:
        depth: planar depth of the left eye [m], (height, width), float32; not finite where unknown.
        rig: places and focal lengths of eye and color camera.

    Returns:
        (height, width), int32.
    """
    k = rig.intrinsics
    check_shape("depth", depth, (k.height, k.width))
    nearest = np.empty(depth.shape, dtype=np.float32)
    source = np.empty(depth.shape, dtype=np.int32)
    images = [wp.array(image, device="cpu", copy=False) for image in (nearest, source)]
    inputs = [
        wp.array(np.ascontiguousarray(depth), device="cpu", copy=False),
        rig.color_zoom,
        rig.image_intrinsics.fx * rig.color_offset,
        k.cx,
        k.cy,
        *images,
    ]
    launch_rows(_register_kernel, k.height, inputs)
    return source
