"""A full search of images an eighth of the size: what a matcher might prefer to the truth."""

import numpy as np

from digs_warp.sim.sensor.guided.blocks import BLOCK
from digs_warp.sim.sensor.matcher import match

# The full search runs on images this many times smaller; there, a block is one disparity.
COARSE = BLOCK


def coarse_half_blocks(left: np.ndarray, right: np.ndarray, count: int, window: int) -> np.ndarray:
    """Return what a full search of small images prefers, in half blocks, int32, -1 where it finds none.

    Without its checks: a wrong match in repeating or missing texture is what the pixel should try.

    Args:
        left: gray image, (height, width), uint8.
        right: of the same size.
        count: of the blocks in the search range.
        window: width of the matching window [px].

    Returns:
        One for every 8 x 8 pixels: twice the block, plus one in its upper half.
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
    return np.floor(2 * found).clip(-1).astype(np.int32)
