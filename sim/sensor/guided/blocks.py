"""Which disparities each pixel tries: four blocks of eight, packed into one integer.

Bits 0 to 27 hold the four blocks in ascending order, 7 bits each; block k has the disparities 8 k to 8 k + 7.
Bits 28 to 30 say whether the first and second, second and third, third and fourth block are neighbors.
"""

import numpy as np
import warp as wp

from digs_warp.device.parallel import launch_parallel
from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.matcher import match

start_warp()
wp.set_module_options({"enable_backward": False})

BLOCK = 8  # disparities
BLOCKS = 4  # per pixel
MAX_BLOCKS = 128  # that a block's 7 bits can number

# How far away [px] a depth step makes a pixel try the disparity of the other side, and what is a step [px]:
# a window of five pixels and the paths' smoothness reach about this far.
STEP_REACH = 4
STEP = 2.0

# The full search runs on images this many times smaller; there, a block is one disparity.
COARSE = BLOCK

_COARSE = wp.constant(COARSE)
_STEP = wp.constant(STEP)
_BLOCK_BITS = wp.constant(7)


@wp.func
def is_free(block: int, chosen: wp.vec4i, at: int, count: int) -> bool:
    """Return whether a block is inside the search range and not among the others that were chosen."""
    free = block >= 0 and block < count
    for i in range(4):
        free = free and (i == at or chosen[i] != block)
    return free


@wp.func
def packed(chosen: wp.vec4i) -> int:
    """Return four different blocks in the form that the module describes."""
    low = wp.min(chosen[0], chosen[1])
    high = wp.max(chosen[0], chosen[1])
    low2 = wp.min(chosen[2], chosen[3])
    high2 = wp.max(chosen[2], chosen[3])
    first = wp.min(low, low2)
    fourth = wp.max(high, high2)
    middle = wp.max(low, low2)
    middle2 = wp.min(high, high2)
    second = wp.min(middle, middle2)
    third = wp.max(middle, middle2)
    bits = first | (second << 7) | (third << 14) | (fourth << 21)
    if second == first + 1:
        bits |= 1 << 28
    if third == second + 1:
        bits |= 1 << 29
    if fourth == third + 1:
        bits |= 1 << 30
    return bits


@wp.func
def four_blocks(own: int, side: int, other: int, far: int, count: int) -> int:
    """Return the blocks of a pixel, packed.

    Args:
        own: block of the true disparity.
        side: 1 if it lies in the upper half of the block, else -1.
        other: block of the disparity beyond a nearby step; negative: none.
        far: block that the coarse search prefers; negative: none.
        count: of the blocks in the search range, at least 4.
    """
    third = own - side
    fourth = own + 2 * side
    has_other = other >= 0 and wp.abs(other - own) > 1
    has_far = far >= 0 and wp.abs(far - own) > 1
    if has_other:
        fourth = other
    if has_far:
        if has_other:
            third = other
        fourth = far
    chosen = wp.vec4i(own, own + side, third, fourth)
    for i in range(1, 4):
        if not is_free(chosen[i], chosen, i, count):
            chosen[i] = -1
    for i in range(1, 4):  # the nearest free block takes the place of one that cannot be
        for distance in range(1, 2 * 4):
            if chosen[i] < 0 and is_free(own + distance * side, chosen, i, count):
                chosen[i] = own + distance * side
            if chosen[i] < 0 and is_free(own - distance * side, chosen, i, count):
                chosen[i] = own - distance * side
    return packed(chosen)


@wp.kernel
def blocks_kernel(
    first: int,
    surface: wp.array2d[float],  # true disparity [px], 0 where there is nothing
    nearest: wp.array2d[float],  # largest disparity round the pixel
    farthest: wp.array2d[float],  # smallest
    coarse: wp.array2d[int],  # block that the coarse search prefers, negative: none
    count: int,
    # outputs
    blocks: wp.array2d[int],
):
    """Choose the blocks of one row."""
    row = first + wp.tid()
    coarse_row = wp.min(row / _COARSE, coarse.shape[0] - 1)
    last_key = int(-1)
    bits = int(0)
    for column in range(surface.shape[1]):
        # What lies farther left has no partner in the right image.
        disparity = wp.min(surface[row, column], float(column))
        own = wp.clamp(int(disparity / 8.0), 0, count - 1)
        side = -1
        if disparity - 8.0 * float(own) >= 4.0:
            side = 1
        other = -1
        if disparity - farthest[row, column] > _STEP:
            other = int(farthest[row, column] / 8.0)
        if nearest[row, column] - disparity > _STEP:
            other = int(nearest[row, column] / 8.0)
        far = coarse[coarse_row, wp.min(column / _COARSE, coarse.shape[1] - 1)]
        key = ((own * 4 + side + 1) * 256 + other + 1) * 256 + far + 1
        if key != last_key:  # neighbors mostly have the same blocks
            bits = four_blocks(own, side, other, far, count)
            last_key = key
        blocks[row, column] = bits


def choose_blocks(
    disparity: np.ndarray, left: np.ndarray, right: np.ndarray, count: int, window: int
) -> wp.array:
    """Return the blocks that each pixel tries, packed, (height, width), int32.

    Args:
        disparity: true disparity [px], (height, width), float32, NaN where there is nothing.
        left: gray image, (height, width), uint8.
        right: of the same size.
        count: of the blocks in the search range, 4 to 128.
        window: width of the matching window [px].
    """
    import cv2

    true = np.nan_to_num(disparity, nan=0.0, posinf=0.0)
    around = np.ones((2 * STEP_REACH + 1, 2 * STEP_REACH + 1), np.uint8)
    inputs = [true, cv2.dilate(true, around), cv2.erode(true, around)]
    coarse = coarse_blocks(left, right, count, window)
    blocks = wp.empty(disparity.shape, dtype=int, device="cpu")
    launch_parallel(
        blocks_kernel,
        disparity.shape[0],
        [*(wp.array(a, device="cpu", copy=False) for a in (*inputs, coarse)), count, blocks],
    )
    return blocks


def coarse_blocks(left: np.ndarray, right: np.ndarray, count: int, window: int) -> np.ndarray:
    """Return the blocks that a full search of small images prefers, int32, -1 where it finds none.

    Without its checks: a wrong match in repeating or missing texture is what the pixel should try.

    Args:
        left: gray image, (height, width), uint8.
        right: of the same size.
        count: of the blocks in the search range.
        window: width of the matching window [px].

    Returns:
        One block for every 8 x 8 pixels.
    """
    import cv2

    height, width = left.shape
    size = (max(1, width // COARSE), max(1, height // COARSE))
    small, small_right = (
        cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image in (left, right)
    )
    disparities = -(-count // 16) * 16
    found = match(small, small_right, disparities, window, checks=False)
    found[~(found < count)] = -1
    return found.astype(np.int32)
