"""Where two blocks are enough: both eyes see the same strong texture at the true disparity.

There, no disparity far from the truth can win. In squares of 8 x 8 pixels, the difference between the eyes at
the true disparity is compared with the gradient. Where noise makes both, their ratio is about 0.75,
whatever the noise.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.parallel import launch_parallel
from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.guided.planes import EyePlanes

start_warp()
wp.set_module_options(vector_module_options())

SQUARE = 8  # [px]

# A square is easy if the difference is less than this share of the gradient there and in all squares around.
# On the sample meshes, up to 0.03 % of the pixels there then differ from a search of four blocks; from 0.7,
# patches of nothing but noise pass.
LARGEST_RATIO = 0.5

# Weaker gradients are never easy [DN/px], mean of a square: without noise, ratios of rounding say nothing.
LEAST_GRADIENT = 1.0

# Written with Clang's vector types: a row of a square is one vector.
_SUMS = r"""
typedef unsigned char Bytes __attribute__((ext_vector_type(8), aligned(1)));
typedef unsigned short Shorts __attribute__((ext_vector_type(8)));
const int plane = height * pitch;
auto minus = [](Bytes a, Bytes b) -> Bytes { return __builtin_elementwise_sub_sat(a, b); };
auto at = [](const unsigned char* pixel) -> Bytes { return *(const Bytes*)pixel; };
// How far values are outside the range around their partners.
auto outside = [&](Bytes value, const unsigned char* partner) -> Bytes {
    const Bytes low = at(partner + plane), high = at(partner + 2 * plane);
    return __builtin_elementwise_max(minus(value, high), minus(low, value));
};
for (int square = 0; square < squares; ++square) {
    const int x = 8 * square;
    Shorts differences = 0, gradients = 0;
    bool is_seen = true;  // by the right eye
    for (int y = y0; y < y0 + 8; ++y) {
        // All pixels of the row have the disparity of its middle.
        const float disparity = surface.data[y * width + x + 4];
        is_seen = is_seen && disparity <= x;
        const int first = 3 * plane + y * pitch + searched + x;
        const int shift = is_seen ? (int)(disparity + 0.5f) : 0;
        const unsigned char* left = left_planes.data + first;
        const unsigned char* right = right_planes.data + first - shift;
        const Bytes least = __builtin_elementwise_min(outside(at(left), right), outside(at(right), left));
        differences += __builtin_convertvector(least, Shorts);
        const Bytes here = at(left), after = at(left + 2);
        gradients += __builtin_convertvector(minus(here, after) + minus(after, here), Shorts);
    }
    int difference = 0, gradient = 0;
    for (int i = 0; i < 8; ++i) {
        difference += differences[i];
        gradient += gradients[i];
    }
    sums.data[y0 / 8 * squares + square] = is_seen ? difference : UNSEEN;
    sums.data[(y0 / 8 + height / 8) * squares + square] = gradient;
}
"""

# Sum of the differences where the partner is outside the right image: more than any square can have.
UNSEEN = 20000


@wp.func_native(f"constexpr int UNSEEN = {UNSEEN};" + _SUMS)
def write_sums(
    left_planes: wp.array[wp.uint8],
    right_planes: wp.array[wp.uint8],
    surface: wp.array[float],
    sums: wp.array[wp.int16],  # [2, height / 8, squares]
    y0: int,
    squares: int,
    width: int,
    height: int,
    pitch: int,
    searched: int,
):
    """Sum the differences at the true disparity, and twice the gradients, over the squares of a row."""
    ...


@wp.kernel
def sums_kernel(
    first: int,
    left_planes: wp.array[wp.uint8],
    right_planes: wp.array[wp.uint8],
    surface: wp.array[float],
    squares: int,
    width: int,
    height: int,
    pitch: int,
    searched: int,
    # outputs
    sums: wp.array[wp.int16],
):
    """Process one row of squares."""
    # fmt: off
    write_sums(left_planes, right_planes, surface, sums, (first + wp.tid()) * 8, squares, width, height,
               pitch, searched)
    # fmt: on


def easy_squares(eyes: EyePlanes, surface: np.ndarray) -> np.ndarray:
    """Return where two blocks are enough, bool, one for each square; the last columns have none.

    Args:
        eyes: planes of the two images.
        surface: true disparity [px], (height, width), float32, 0 to the end of the search range.
    """
    import cv2

    differences, gradients = _sums(eyes, surface)
    if not differences.size:
        return np.zeros(differences.shape, bool)
    # Weights 1/4, 1/2, 1/4: half of the window and of the paths lies outside a square.
    weights = np.array([0.25, 0.5, 0.25])
    difference, gradient = (
        cv2.sepFilter2D(sums.astype(np.float32), cv2.CV_32F, weights, weights)
        for sums in (differences, gradients)
    )
    ratio = 2 * difference / np.maximum(gradient, 1)
    ratio[gradient < 2 * SQUARE * SQUARE * LEAST_GRADIENT] = np.inf
    return cv2.dilate(ratio, np.ones((3, 3), np.uint8)) < LARGEST_RATIO


def _sums(eyes: EyePlanes, surface: np.ndarray) -> np.ndarray:
    """Return the sums of differences and of twice the gradients, (2, height / 8, (width - 2) / 8), int16."""
    rows, columns = eyes.height // SQUARE, max(eyes.width - 2, 0) // SQUARE
    sums = wp.empty(2 * rows * columns, dtype=wp.int16, device="cpu")
    if rows and columns:
        launch_parallel(
            sums_kernel,
            rows,
            [
                *(eyes.left, eyes.right),
                wp.array(surface.reshape(-1), dtype=float, device="cpu", copy=False),
                *(columns, eyes.width, eyes.height, eyes.pitch, eyes.searched, sums),
            ],
        )
    return sums.numpy().reshape(2, rows, columns)
