"""How a sensor errs on a pair with true disparity: its errors, its holes, and how smooth the errors are."""

import numpy as np

from digs_warp.sim.fit.depth_noise import correlation_length
from digs_warp.sim.fit.estimate import (
    UNKNOWN,
    Estimate,
    block_numbers,
    block_sums,
    jackknife,
    ratio,
)
from digs_warp.sim.fit.holes import median_size, small_share
from digs_warp.sim.fit.range_and_step import in_both_eyes
from digs_warp.sim.sensor.blame import WRONG
from digs_warp.sim.sensor.effects.static_field import SCALE
from digs_warp.sim.sensor.filters import patch_areas

# A square counts if that share of it has good values.
KNOWN = 0.3

BAD, RMS = "share wrong by more than a pixel", "RMS of the other errors [px]"


def scores(disparity: np.ndarray, true: np.ndarray, where: np.ndarray) -> dict[str, Estimate]:
    """Return statistics of the errors in a part of the image.

    Args:
        disparity: of the sensor [px], (height, width), NaN where it has none.
        true: disparity, likewise.
        where: the part, (height, width), bool.
    """
    blocks = block_numbers(true.shape)
    error = np.where(where, disparity - true, np.nan)
    good = np.where(np.abs(error) <= WRONG, error, np.nan)
    inside = where & np.isfinite(true) & in_both_eyes(np.nan_to_num(true))
    hole = inside & np.isnan(disparity)

    def mean(values: np.ndarray, of: np.ndarray) -> Estimate:
        parts = [np.where(of, values, np.nan), np.where(of, 1.0, np.nan)]
        return jackknife(np.stack([block_sums(x, blocks) for x in parts], axis=1), ratio)

    sizes = patch_areas(hole)
    return {
        BAD: mean((np.abs(error) > WRONG).astype(float), np.isfinite(error)),
        RMS: mean(good**2, np.isfinite(good)).root(),
        "mean of the other errors [px]": mean(good, np.isfinite(good)),
        "of that RMS, smooth [px]": smooth_variance(good).root(),
        "correlation length of the errors [px]": correlation_length(good, blocks),
        "share without depth": mean(hole.astype(float), inside),
        "of that, in holes of up to 3 pixels": Estimate(small_share(sizes), np.nan),
        "half of the hole area is in smaller holes [px]": Estimate(median_size(sizes), np.nan),
    }


def square_side(width: int) -> int:
    """Return the side of the squares whose means show the static field: its correlation length [px]."""
    return max(4, round(SCALE * width))


def square_means(values: np.ndarray) -> np.ndarray:
    """Return the mean of each square of `square_side`, (n,), NaN where too little of it is known."""
    side = square_side(values.shape[1])
    rows, columns = (size // side for size in values.shape)
    squares = values[: rows * side, : columns * side].reshape(rows, side, columns, side)
    count = np.isfinite(squares).sum(axis=(1, 3))
    sums = np.nansum(squares, axis=(1, 3))
    return np.where(count >= KNOWN * side**2, sums / np.maximum(count, 1), np.nan).ravel()


def smooth_variance(good: np.ndarray) -> Estimate:
    """Return the variance of the error's means over squares [px^2]."""
    return _mean_square(square_means(good), np.zeros(1))


def excess_variance(measured: np.ndarray, simulated: np.ndarray) -> Estimate:
    """Return by how much the means over squares vary more in the first error image [px^2].

    The squares are compared one by one, so that what both share does not count as an error.
    """
    return _mean_square(square_means(measured), square_means(simulated))


def _mean_square(first: np.ndarray, second: np.ndarray) -> Estimate:
    both = np.isfinite(first) & np.isfinite(second)
    squares = [np.broadcast_to(x, both.shape)[both] for x in (first, second)]
    if both.sum() < 3:
        return UNKNOWN
    difference = (squares[0] - squares[0].mean()) ** 2 - (squares[1] - squares[1].mean()) ** 2
    count = len(difference)
    return Estimate(
        float(difference.sum() / (count - 1)), float(difference.std(ddof=1) / np.sqrt(count))
    )
