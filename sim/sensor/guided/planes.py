"""What the matching cost compares: gray value and slope of each pixel, and their range half a pixel around.

Birchfield and Tomasi (1998) compare a pixel with the range that the other image takes between half a pixel
left and half a pixel right, so that the cost does not depend on how the sensor samples an edge.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.arrays import launch_rows

start_warp()
wp.set_module_options(vector_module_options())

# Planes of an eye: slope, gray, each as value, lowest and highest.
PLANES = 6

# Columns past the right edge that vector loads may touch.
SLACK = 128

# Plain C: LLVM makes vector code of loops over bytes only when it sees plain pointers.
_ROW = r"""
const unsigned char* g = gray.data + row * pitch;
const unsigned char* above = gray.data + (row > 0 ? row - 1 : row) * pitch;
const unsigned char* below = gray.data + (row < height - 1 ? row + 1 : row) * pitch;
const int plane = height * pitch;
unsigned char* out = planes.data + row * pitch;
unsigned char* slope = out;
slope[0] = slope[width - 1] = 15;
for (int x = 1; x < width - 1; ++x) {
    int s = 2 * (g[x + 1] - g[x - 1]) + above[x + 1] - above[x - 1] + below[x + 1] - below[x - 1];
    s = s < -15 ? -15 : s > 15 ? 15 : s;
    slope[x] = s + 15;
}
unsigned char* value = out + 3 * plane;
for (int x = 0; x < width; ++x) value[x] = g[x];
for (int kind = 0; kind < 2; ++kind) {
    const unsigned char* v = out + 3 * kind * plane;
    unsigned char* low = out + (3 * kind + 1) * plane;
    unsigned char* high = out + (3 * kind + 2) * plane;
    for (int x = 1; x < width - 1; ++x) {
        unsigned char a = (v[x] + v[x - 1]) / 2, b = (v[x] + v[x + 1]) / 2, c = v[x];
        unsigned char least = a < b ? a : b, most = a > b ? a : b;
        low[x] = least < c ? least : c;
        high[x] = most > c ? most : c;
    }
    for (int end = 0; end < 2; ++end) {
        int x = end ? width - 1 : 0, y = width > 1 ? (end ? width - 2 : 1) : 0;
        unsigned char a = (v[x] + v[y]) / 2, c = v[x];
        low[x] = a < c ? a : c;
        high[x] = a > c ? a : c;
    }
}
"""


@wp.func_native(_ROW)
def write_row(
    gray: wp.array[wp.uint8],
    planes: wp.array[wp.uint8],
    row: int,
    width: int,
    height: int,
    pitch: int,
):
    """Write a row of the six planes of an eye; slopes are Sobel's, cut off at 15."""
    ...


@wp.kernel
def planes_kernel(
    first: int,
    gray: wp.array[wp.uint8],
    width: int,
    height: int,
    pitch: int,
    # outputs
    planes: wp.array[wp.uint8],
):
    """Write one row of the planes of an eye."""
    write_row(gray, planes, first + wp.tid(), width, height, pitch)


@dataclass(frozen=True, eq=False)
class EyePlanes:
    """The planes of a pair of images.

    Attributes:
        left: (6 height pitch,), uint8.
        right: of the same size.
        width: of the images [px].
        height: of the images [px].
        pitch: columns of a plane.
        searched: end of the search range [px], and the number of black columns in front of the image, which
            OpenCV's matcher needs (see `digs_warp.sim.sensor.matcher.match`).
    """

    left: wp.array
    right: wp.array
    width: int
    height: int
    pitch: int
    searched: int


def make_planes(left: np.ndarray, right: np.ndarray, disparities: int) -> EyePlanes:
    """Return the planes of a pair.

    Args:
        left: gray image, (height, width), uint8.
        right: of the same size.
        disparities: end of the search range [px].
    """
    height, width = left.shape
    pitch = disparities + width + SLACK
    planes = [_planes(image, disparities, pitch) for image in (left, right)]
    return EyePlanes(planes[0], planes[1], width, height, pitch, disparities)


def _planes(gray: np.ndarray, disparities: int, pitch: int) -> wp.array:
    """Return the six planes of an image, flat; nothing depends on the columns behind it."""
    import cv2

    height, width = gray.shape
    padded = cv2.copyMakeBorder(gray, 0, 0, disparities, SLACK, cv2.BORDER_CONSTANT)
    planes = wp.empty(PLANES * height * pitch, dtype=wp.uint8, device="cpu")
    inputs = [wp.array(padded.reshape(-1), dtype=wp.uint8, device="cpu", copy=False)]
    launch_rows(planes_kernel, height, [*inputs, disparities + width, height, pitch, planes])
    return planes
