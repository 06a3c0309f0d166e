"""How far a match can be trusted, from what the camera itself can see: its cost and its best rival's."""

import numpy as np

from digs_warp.sim.sensor.guided.blocks import BLOCK, BLOCKS, MAX_BLOCKS
from digs_warp.sim.sensor.guided.costs import LARGEST_WINDOW
from digs_warp.sim.sensor.guided.search import PATHS, search

# Odds that a match is within a pixel of the truth: BASE + ODDS (rival - cost) / (cost + FLOOR)^2.5. Even
# where nothing tells it from its rivals, it is right that often. Maximum likelihood, exponents rounded, on
# every other sample mesh; `python -m studies realism` tells how often they are right.
BASE = 0.64
ODDS = 37.7
FLOOR = 0.25

# Mean horizontal gradient [DN/px] below which there is nothing to compare: saturated or black areas. Noise
# alone is several times as much.
LEAST_GRADIENT = 0.25


def confidence_of(
    gray: np.ndarray, disparity: np.ndarray, cost: np.ndarray, rival: np.ndarray, window: int = 5
) -> np.ndarray:
    """Return the probability that each match is within a pixel of the truth, 0 where there is none.

    Args:
        gray: left image, (height, width), uint8.
        disparity: [px], (height, width), float32, NaN where there is no match.
        cost: of the match, sum over the paths and the window, (height, width), int16.
        rival: the same of the best other disparity.
        window: width of the matching window [px].
    """
    import cv2

    summed = PATHS * window * window
    losses = np.arange(int(cost.max()) + 1) / summed + FLOOR
    confidence = (rival - cost) * (ODDS / summed * losses**-2.5).astype(np.float32).take(cost)
    confidence += BASE
    confidence /= 1 + confidence
    # The image is mirrored at its borders, so that there is no gradient.
    twice, (before, after) = np.zeros(gray.shape, np.uint8), (gray[:, :-2], gray[:, 2:])
    np.subtract(np.maximum(before, after), np.minimum(before, after), out=twice[:, 1:-1])
    size = (window, window)
    steps = cv2.boxFilter(twice, cv2.CV_16U, size, normalize=False, borderType=cv2.BORDER_REPLICATE)
    is_flat = steps < np.uint16(np.ceil(2 * LEAST_GRADIENT * window * window))
    confidence *= ~(is_flat | np.isnan(disparity))
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
