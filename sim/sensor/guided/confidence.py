"""How far a match can be trusted, from what the camera itself can see: its cost and its best rival's."""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.parallel import launch_parallel
from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.filters import box_mean
from digs_warp.sim.sensor.guided.blocks import BLOCK, BLOCKS, MAX_BLOCKS
from digs_warp.sim.sensor.guided.costs import LARGEST_WINDOW
from digs_warp.sim.sensor.guided.search import search

start_warp()
wp.set_module_options(vector_module_options())

# Odds that a match is within a pixel of the truth: BASE + ODDS (rival - cost) / (cost + FLOOR)^2.5. Even
# where nothing tells it from its rivals, it is right that often. Maximum likelihood, exponents rounded, on
# matches within the range of the camera on every other sample mesh.
BASE = 0.64
ODDS = 37.7
FLOOR = 0.25

# Mean horizontal gradient [DN/px] below which there is nothing to compare: saturated or black areas. Noise
# alone is several times as much.
LEAST_GRADIENT = 0.25


# Plain C: LLVM makes vector code of it.
_ROW = r"""
const int first = row * width;
for (int i = first; i < first + width; ++i) {
    const float gap = rival.data[i] - cost.data[i], loss = cost.data[i] + FLOOR;
    const float odds = BASE + ODDS * (gap > 0 ? gap : 0) / (loss * loss * __builtin_sqrtf(loss));
    const bool is_match = disparity.data[i] == disparity.data[i] && steps.data[i] >= 2 * LEAST_GRADIENT;
    confidence.data[i] = is_match ? odds / (1 + odds) : 0;
}
"""
_CONSTANTS = f"""
constexpr float BASE = {BASE}, ODDS = {ODDS}, FLOOR = {FLOOR}, LEAST_GRADIENT = {LEAST_GRADIENT};
"""


@wp.func_native(_CONSTANTS + _ROW)
def write_confidence(
    steps: wp.array[float],
    disparity: wp.array[float],
    cost: wp.array[float],
    rival: wp.array[float],
    confidence: wp.array[float],
    row: int,
    width: int,
):
    """Write the confidence of a row."""
    ...


@wp.kernel
def confidence_kernel(
    first: int,
    width: int,
    steps: wp.array[float],  # twice the gradient, mean over the window [DN/px]
    disparity: wp.array[float],
    cost: wp.array[float],
    rival: wp.array[float],
    # outputs
    confidence: wp.array[float],
):
    """Process one row."""
    write_confidence(steps, disparity, cost, rival, confidence, first + wp.tid(), width)


def confidence_of(
    gray: np.ndarray, disparity: np.ndarray, cost: np.ndarray, rival: np.ndarray, window: int = 5
) -> np.ndarray:
    """Return the probability that each match is within a pixel of the truth, 0 where there is none.

    Args:
        gray: left image, (height, width), uint8.
        disparity: [px], (height, width), float32, NaN where there is no match.
        cost: of the match, mean per path and pixel of the window, (height, width), float32.
        rival: the same of the best other disparity.
        window: width of the matching window [px].
    """
    import cv2

    height, width = gray.shape
    # Twice the gradient; the image is mirrored at its borders, so that there is none.
    steps = np.zeros(gray.shape, np.uint8)
    if width > 2:
        cv2.absdiff(gray[:, 2:], gray[:, :-2], steps[:, 1:-1])
    confidence = np.empty(gray.shape, np.float32)
    images = (box_mean(steps, window), disparity, cost, rival, confidence)
    inputs = [wp.array(i.reshape(-1), dtype=float, device="cpu", copy=False) for i in images]
    launch_parallel(confidence_kernel, height, [width, *inputs])
    return confidence


def confidence_in_matches(
    left: np.ndarray, right: np.ndarray, disparity: np.ndarray, disparities: int, window: int = 5
) -> np.ndarray:
    """Return the confidence in matches whose costs are not known: they are searched again near the matches.

    It costs a quarter of the full search; 99 % of its matches are the same within half a pixel.

    Args:
        left: gray image, (height, width), uint8.
        right: of the same size.
        disparity: of the matches [px], (height, width), float32, NaN where there is none.
        disparities: end of the range that was searched [px]; a multiple of 8.
        window: width of the matching window [px].
    """
    searched = min(max(disparities, BLOCKS * BLOCK), MAX_BLOCKS * BLOCK)
    near = search(left, right, disparity, searched, min(window, LARGEST_WINDOW))
    return confidence_of(left, disparity, near.cost, near.rival, window)
