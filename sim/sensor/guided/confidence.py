"""How far a match can be trusted, from what the camera itself can see: its cost and its best rival's."""

import numpy as np

from digs_warp.sim.sensor.filters import box_mean, horizontal_gradient
from digs_warp.sim.sensor.guided.blocks import BLOCK, BLOCKS, MAX_BLOCKS
from digs_warp.sim.sensor.guided.costs import LARGEST_WINDOW
from digs_warp.sim.sensor.guided.search import search

# Odds that a match is within a pixel of the truth: ODDS sqrt(rival - cost) / (cost + FLOOR)^2. Logistic
# regression on the logarithms of the two, exponents rounded, over matches within the range of the camera on
# seven rendered meshes; six others agree (`scripts/tune_guided.py`, docs/sensor-cost.md).
ODDS = 118.0
FLOOR = 0.5

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
        cost: of the match, mean per path and pixel of the window, (height, width), float32.
        rival: the same of the best other disparity.
        window: width of the matching window [px].
    """
    odds = np.float32(ODDS) * np.sqrt(np.maximum(rival - cost, 0))
    odds /= np.square(cost + np.float32(FLOOR))
    odds[box_mean(np.abs(horizontal_gradient(gray)), window) < LEAST_GRADIENT] = 0
    odds /= 1 + odds
    odds[np.isnan(disparity)] = 0
    return odds


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
