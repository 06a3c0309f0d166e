"""Which disparities each pixel tries: four blocks of eight, packed into one integer.

Bits 0 to 27 hold four blocks in ascending order, 7 bits each; block k has the disparities 8 k to 8 k + 7.
Bits 28 to 30 say whether the first and second, second and third, third and fourth block are neighbors.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import vector_module_options
from digs_warp.sim.sensor.arrays import launch_rows, shared

wp.set_module_options(vector_module_options())

BLOCK = 8  # disparities
BLOCKS = 4  # per pixel
MAX_BLOCKS = 128  # that a block's 7 bits can number

# How far away [px] a depth step makes a pixel try the disparity of the other side, and what is a step [px]:
# a window of five pixels and the paths' smoothness reach about this far.
STEP_REACH = 4
STEP = 2.0

# Plain C: LLVM makes vector code of the first loop.
_ROW = r"""
const float* true_row = surface.data + row * width;
const float* near_row = nearest.data + row * width;
const float* far_row = farthest.data + row * width;
int* out = blocks.data + row * width;
// What decides on the blocks: own block, side, the block beyond a step plus one, the half block from the
// coarse search plus one, whether the pixel is hidden.
for (int x = 0; x < width; ++x) {
    // What lies farther left has no partner in the right image.
    const float disparity = true_row[x] < x ? true_row[x] : x;
    const int whole = (int)(disparity * 0.125f);
    const int own = whole < count ? whole : count - 1;
    const int side = disparity - 8.0f * own >= 4.0f;
    const int beyond = disparity - far_row[x] > STEP ? (int)(far_row[x] * 0.125f) + 1 : 0;
    const int other = near_row[x] - disparity > STEP ? (int)(near_row[x] * 0.125f) + 1 : beyond;
    out[x] = own | side << 7 | other << 8;
}
// The right eye does not see what lies, in its image, to the right of something that follows in the left one.
typedef float Floats __attribute__((ext_vector_type(16), aligned(4)));
typedef int Ints __attribute__((ext_vector_type(16), aligned(4)));
const Floats steps = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
auto min = [](Floats a, Floats b) -> Floats { return a < b ? a : b; };
float least = width;  // column of the right image, of all pixels from here on
int rest = width;
for (; rest >= 16; rest -= 16) {
    const Floats at = steps + (float)(rest - 16);
    const Floats columns = at - min(*(const Floats*)(true_row + rest - 16), at);
    // The least from each of the sixteen on; the last one stands for those after it.
    Floats from = columns;
    from = min(from,
        __builtin_shufflevector(from, from, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 15));
    from = min(from,
        __builtin_shufflevector(from, from, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 15, 15));
    from = min(from,
        __builtin_shufflevector(from, from, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 15, 15, 15, 15));
    from = min(from,
        __builtin_shufflevector(from, from, 8, 9, 10, 11, 12, 13, 14, 15, 15, 15, 15, 15, 15, 15, 15, 15));
    from = min(from, (Floats)least);
    *(Ints*)(out + rest - 16) |= (columns > from + 1.0f) & 1 << 26;
    least = from[0];
}
while (--rest >= 0) {
    const float column = true_row[rest] < rest ? rest - true_row[rest] : 0.0f;
    out[rest] |= (column > least + 1.0f) << 26;
    least = column < least ? column : least;
}
const int coarse_row = (row >> 3) < coarse_height ? row >> 3 : coarse_height - 1;
const int* preferred = coarse.data + coarse_row * coarse_width;
int preferred_half = 0, of_square = 0, last = -1, last_second = -1, bits = 0;
for (int x = 0; x < width; ++x) {
    if ((x & 7) == 0) {
        const int square = x >> 3;
        preferred_half = preferred[square < coarse_width ? square : coarse_width - 1];
        of_square = (preferred_half + 1) << 16;
    }
    int second = -1;  // twice its block, plus one in the upper half
    if (has_second) {
        const float behind = seconds.data[row * width + x];
        if (behind >= 0 && behind < 8.0f * count)  // or there is none
            second = (int)((behind < x ? behind : x) * 0.25f);
    }
    const int key = out[x] | of_square;
    if (key == last && second == last_second) {  // as mostly among neighbors
        out[x] = bits;
        continue;
    }
    const bool is_hidden = key >> 26 & 1;
    last = key;
    last_second = second;
    const int own = key & 127, side = (key >> 7 & 1) ? 1 : -1, other = (key >> 8 & 255) - 1;
    const int far = preferred_half >> 1;  // -1: none
    // In order of importance; the last ones are the nearest that are free.
    const int behind = second >> 1, beside = behind + (second & 1 ? 1 : -1);
    const bool beside_far = is_hidden && far >= 0;
    const int far_side = preferred_half & 1 ? 1 : -1;
    const int wanted[] = {own, is_hidden ? -1 : own + side, second < 0 ? -1 : behind, other, far,
        is_hidden || second < 0 ? -1 : beside, beside_far ? far + far_side : -1,
        beside_far ? far - far_side : -1, own + side, own - side, own + 2 * side, own - 2 * side,
        own + 3 * side, own - 3 * side};
    int chosen[4], found = 0;
    for (int i = 0; found < 4; ++i) {
        const int block = wanted[i];
        bool is_free = block >= 0 && block < count;
        for (int j = 0; j < found; ++j)
            is_free = is_free && chosen[j] != block;
        if (!is_free)
            continue;
        int place = found++;
        for (; place > 0 && chosen[place - 1] > block; --place)
            chosen[place] = chosen[place - 1];
        chosen[place] = block;
    }
    bits = chosen[0] | chosen[1] << 7 | chosen[2] << 14 | chosen[3] << 21;
    for (int i = 0; i < 3; ++i)
        bits |= (chosen[i + 1] == chosen[i] + 1) << (28 + i);
    out[x] = bits;
}
"""


@wp.func_native(f"constexpr float STEP = {STEP};" + _ROW)
def write_blocks(
    surface: wp.array[float],
    nearest: wp.array[float],
    farthest: wp.array[float],
    seconds: wp.array[float],
    coarse: wp.array[int],
    blocks: wp.array[int],
    has_second: bool,
    row: int,
    width: int,
    coarse_width: int,
    coarse_height: int,
    count: int,
):
    """Choose the blocks of one row."""
    ...


@wp.kernel
def blocks_kernel(
    first: int,
    surface: wp.array[float],  # true disparity [px], 0 where there is nothing
    nearest: wp.array[float],  # largest disparity round the pixel
    farthest: wp.array[float],  # smallest
    seconds: wp.array[float],  # disparity of the second surface, NaN where there is none
    coarse: wp.array[int],  # what the coarse search prefers, in half blocks, negative: none
    has_second: bool,
    width: int,
    coarse_width: int,
    coarse_height: int,
    count: int,
    # outputs
    blocks: wp.array[int],
):
    """Process one row."""
    # fmt: off
    write_blocks(surface, nearest, farthest, seconds, coarse, blocks, has_second, first + wp.tid(), width,
                 coarse_width, coarse_height, count)
    # fmt: on


def choose_blocks(
    surface: np.ndarray,
    coarse: np.ndarray,
    count: int,
    second: np.ndarray | None = None,
) -> wp.array:
    """Return the blocks that each pixel tries, packed, (height, width), int32.

    In order of importance: the block of the true disparity and the nearer neighbor; that of a second
    surface; the one beyond a depth step; the one that the coarse search prefers; the neighbor of the second
    surface's; more of its own neighbors. What only the left eye sees matches nothing right: there, the
    neighbors of the block from the coarse search come instead of its own.

    Args:
        surface: true disparity [px], (height, width), float32, 0 to 8 ``count``, 0 where there is nothing.
        coarse: half blocks from `digs_warp.sim.sensor.guided.search.coarse_half_blocks`.
        count: of the blocks in the search range, 4 to 128.
        second: disparity of what shows through or is reflected [px], (height, width), float32, NaN where
            there is nothing of that kind; None: nowhere.
    """
    import cv2

    height, width = surface.shape
    around = np.ones((2 * STEP_REACH + 1, 2 * STEP_REACH + 1), np.uint8)
    images = [surface, cv2.dilate(surface, around), cv2.erode(surface, around)]
    images.append(surface if second is None else np.ascontiguousarray(second, np.float32))
    blocks = wp.empty(surface.shape, dtype=int, device="cpu")
    launch_rows(
        blocks_kernel,
        height,
        [
            *map(shared, (*images, coarse)),
            *(second is not None, width, *coarse.shape[::-1], count),
            blocks.flatten(),
        ],
    )
    return blocks
