"""`digs_warp.measure.ssim.similarity_kernel` for GPUs: a thread per pixel, in passes over the whole image.

The formulas are those of `digs_warp.measure.ssim`. Images are blurred along the rows and then along the
columns; what the passes leave lies in planes like those of the image. Neighboring threads read neighboring
addresses, and the windows of a row overlap in the cache. All pixels are computed, whether they count or not:
that takes less time than a GPU needs to begin.
"""

from typing import Any

import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch
from digs_warp.measure.ssim import (
    BLOCK_COLUMNS,
    BLOCK_ROWS,
    C1,
    C2,
    REACH,
    WINDOW,
    Terms,
    window_weights,
)

# As in `digs_warp.measure.ssim`: if products and sums were fused, equal images would differ.
wp.set_module_options({"enable_backward": False, "fuse_fp": False})

# Rows that one thread sums.
SUMMED_ROWS = 64

_Window = wp.types.vector(length=WINDOW, dtype=float)
_WEIGHTS = wp.constant(_Window(*window_weights()))
_REACH = wp.constant(REACH)
_WINDOW = wp.constant(WINDOW)
_C1 = wp.constant(C1)
_C2 = wp.constant(C2)
_ROWS = wp.constant(BLOCK_ROWS)
_COLUMNS = wp.constant(BLOCK_COLUMNS)
_SUMMED = wp.constant(SUMMED_ROWS)


@wp.func
def place_of(terms: Terms, i: int) -> wp.vec4i:
    """Column, row, channel and index of the i-th pixel of three planes; index -1: outside of the view."""
    x = i % terms.columns
    y = i // terms.columns % terms.rows
    channel = i // terms.columns // terms.rows
    p = terms.layout.origin + channel * terms.layout.plane + y * terms.layout.pitch + x
    inside = x < terms.layout.width and y < terms.layout.height
    return wp.vec4i(x, y, channel, wp.where(inside, p, -1))


@wp.func
def blurred(values: wp.array[float], at: int, step: int, place: int, length: int) -> float:
    """Blur along a line of ``length`` values, ``step`` apart, around the one at ``place`` in it."""
    total = float(0.0)
    for tap in range(_WINDOW):
        offset = tap - _REACH
        if place + offset >= 0 and place + offset < length:
            total += _WEIGHTS[tap] * values[at + offset * step]
    return total


@wp.kernel
def moments_kernel(
    first: int,
    terms: Terms,
    image: wp.array[float],  # 3 padded planes
    target: wp.array[float],  # 3 padded planes
    # outputs
    moments: wp.array[float],  # x, y, x^2 + y^2, x y of all pixels, blurred along the rows
):
    """Blur the images and their products along the rows."""
    place = place_of(terms, first + wp.tid())
    if place[3] < 0:
        return
    total = wp.vec4(0.0, 0.0, 0.0, 0.0)
    for tap in range(_WINDOW):
        offset = tap - _REACH
        if place[0] + offset >= 0 and place[0] + offset < terms.layout.width:
            x = image[place[3] + offset]
            y = target[place[3] + offset]
            total += _WEIGHTS[tap] * wp.vec4(x, y, x * x + y * y, x * y)
    for moment in range(4):
        moments[place[3] + moment * terms.size] = total[moment]


@wp.kernel
def slopes_kernel(
    first: int,
    terms: Terms,
    moments: wp.array[float],
    # outputs
    slopes: wp.array[float],  # dSSIM/dm_x, dSSIM/de_xx, dSSIM/de_xy and 1 - SSIM of all pixels
):
    """Blur the moments along the columns; find SSIM and its derivatives."""
    place = place_of(terms, first + wp.tid())
    if place[3] < 0:
        return
    blurs = wp.vec4(0.0, 0.0, 0.0, 0.0)
    for moment in range(4):
        at = place[3] + moment * terms.size
        blurs[moment] = blurred(moments, at, terms.layout.pitch, place[1], terms.layout.height)
    mean_x = blurs[0]
    mean_y = blurs[1]
    squares = mean_x * mean_x + mean_y * mean_y
    a = 2.0 * mean_x * mean_y + _C1
    b = 2.0 * (blurs[3] - mean_x * mean_y) + _C2
    d = squares + _C1
    e = blurs[2] - squares + _C2
    inverse = 1.0 / (d * e)
    ssim = a * b * inverse
    g_xx = -ssim * d * inverse
    g_xy = 2.0 * a * inverse
    g_mean = 2.0 * (mean_y * b * inverse - mean_x * ssim * e * inverse)
    g_mean = g_mean - 2.0 * mean_x * g_xx - mean_y * g_xy
    slopes[place[3]] = g_mean
    slopes[place[3] + terms.size] = g_xx
    slopes[place[3] + 2 * terms.size] = g_xy
    slopes[place[3] + 3 * terms.size] = 1.0 - ssim


@wp.kernel
def row_blur_kernel(
    first: int,
    terms: Terms,
    slopes: wp.array[float],
    # outputs
    moments: wp.array[float],  # the three derivatives, blurred along the rows
):
    """Blur the derivatives along the rows."""
    place = place_of(terms, first + wp.tid())
    if place[3] < 0:
        return
    for slope in range(3):
        at = place[3] + slope * terms.size
        moments[at] = blurred(slopes, at, 1, place[0], terms.layout.width)


@wp.kernel
def gradient_kernel(
    first: int,
    terms: Terms,
    active: wp.array2d[int],  # [blocks_y, blocks_x] not 0 where the loss counts
    image: wp.array[float],
    target: wp.array[float],
    moments: wp.array[float],
    # outputs
    adj_image: wp.array[float],  # 3 padded planes, written where the loss counts
):
    """Blur the derivatives along the columns; write the gradient of the loss."""
    place = place_of(terms, first + wp.tid())
    if place[3] < 0:
        return
    if active[place[1] // _ROWS, place[0] // _COLUMNS] == 0:
        return
    blurs = wp.vec3(0.0, 0.0, 0.0)
    for slope in range(3):
        at = place[3] + slope * terms.size
        blurs[slope] = blurred(moments, at, terms.layout.pitch, place[1], terms.layout.height)
    x = image[place[3]]
    y = target[place[3]]
    d_ssim = blurs[0] + 2.0 * x * blurs[1] + y * blurs[2]
    sign = wp.where(x > y, 1.0, wp.where(x < y, -1.0, 0.0))
    adj_image[place[3]] = terms.l1_weight * sign - terms.dssim_weight * d_ssim


@wp.kernel
def sum_kernel(
    first: int,
    terms: Terms,
    active: wp.array2d[int],
    image: wp.array[float],
    target: wp.array[float],
    slopes: wp.array[float],
    # outputs
    sums: wp.array2d[float],  # [3 * segments * columns, 2] sums of |x - y| and of 1 - SSIM
):
    """Sum a part of a column where the loss counts."""
    i = first + wp.tid()
    x = i % terms.columns
    segments = (terms.rows + _SUMMED - 1) // _SUMMED
    top = i // terms.columns % segments * _SUMMED
    channel = i // terms.columns // segments
    l1 = float(0.0)
    dssim = float(0.0)
    if x < terms.layout.width:
        for y in range(top, wp.min(top + _SUMMED, terms.layout.height)):
            if active[y // _ROWS, x // _COLUMNS] != 0:
                p = terms.layout.origin + channel * terms.layout.plane + y * terms.layout.pitch + x
                l1 += wp.abs(image[p] - target[p])
                dssim += slopes[p + 3 * terms.size]
    sums[i, 0] = l1
    sums[i, 1] = dssim


def similarity_of_pixels(
    terms: Any, active: wp.array, image: ImagePlanes, target: ImagePlanes, adj_image: ImagePlanes
) -> tuple[list[ParallelLaunch], wp.array]:
    """Record the passes; the interface is that of `digs_warp.losses.photometric.similarity_of_strips`."""
    device = str(image.data.device)
    pixels = 3 * image.max_width * image.max_height
    summed = 3 * image.max_width * -(-image.max_height // SUMMED_ROWS)
    sums = wp.zeros((summed, 2), dtype=float, device=device)
    moments = wp.zeros(12 * image.plane, dtype=float, device=device)
    slopes = wp.zeros_like(moments)
    x, y = image.data, target.data
    passes = (
        (moments_kernel, pixels, [x, y, moments]),
        (slopes_kernel, pixels, [moments, slopes]),
        (row_blur_kernel, pixels, [slopes, moments]),
        (gradient_kernel, pixels, [active, x, y, moments, adj_image.data]),
        (sum_kernel, summed, [active, x, y, slopes, sums]),
    )
    return [ParallelLaunch(kernel, n, [terms, *given], device) for kernel, n, given in passes], sums
