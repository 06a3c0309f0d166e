"""Kernel of `digs_warp.init.seen_colors`: the colors in which a photograph sees points. One thread each."""

import warp as wp

from digs_warp.device.eyes import Eye, pixel_seen

wp.set_module_options({"enable_backward": False})

# A color is the mean of this many pixels squared: about a Gaussian's.
BLOCK = 3
# A photograph sees a point if its depth there agrees within this share of the distance.
AGREEMENT = 0.015

_REACH = wp.constant(BLOCK // 2)
_MARGIN = wp.constant(wp.float64(BLOCK // 2))
_PIXELS = wp.constant(wp.float64(BLOCK**2))
_AGREEMENT = wp.constant(wp.float64(AGREEMENT))


@wp.kernel
def seen_colors_kernel(
    first: int,
    points: wp.array[wp.vec3d],  # [n] in the world [m]
    eyes: wp.array[Eye],  # [1]
    image: wp.array3d[wp.uint8],  # [height, width, 3] sRGB
    mask: wp.array2d[wp.uint8],  # [height, width] 255 on the object; empty: everywhere
    depth: wp.array2d[float],  # [height, width] [m], NaN: unknown; empty: not asked
    # output
    colors: wp.array[wp.vec3d],  # [n] sRGB in 0..1; those of points that are not seen stay
):
    """Look at one point."""
    i = first + wp.tid()
    eye = eyes[0]
    seen = pixel_seen(eye, points[i])
    u = wp.floor(seen[0])
    v = wp.floor(seen[1])
    inside = seen[2] > wp.float64(0.0) and u >= _MARGIN and v >= _MARGIN
    inside = inside and u < wp.float64(eye.width) - _MARGIN
    inside = inside and v < wp.float64(eye.height) - _MARGIN
    if not inside:
        return
    row = int(v)
    column = int(u)
    if depth.shape[0] > 0:
        apart = wp.abs(wp.float64(depth[row, column]) - seen[2])
        if not apart <= _AGREEMENT * seen[2]:  # also where the depth is NaN
            return
    total = wp.vec3d()
    for y in range(row - _REACH, row + _REACH + 1):
        for x in range(column - _REACH, column + _REACH + 1):
            if mask.shape[0] > 0:
                if mask[y, x] != wp.uint8(255):
                    return
            for channel in range(3):
                share = wp.float64(image[y, x, channel]) / wp.float64(255.0)
                total[channel] = total[channel] + share
    colors[i] = total / _PIXELS
