"""How far the errors of two sensors agree: where they lie, how large they are, how they change."""

import numpy as np

from digs_warp.sim.sensor.error_attribution import WRONG

BLOCK = 20  # [px]; places are compared in squares of this size
SMALL_HOLE = 3  # [px]


def agreement(
    disparity: np.ndarray, yardstick: np.ndarray, true: np.ndarray
) -> tuple[float, float]:
    """Return the rank correlations of failures and of RMS errors over blocks, -1 to 1.

    Args:
        disparity: of a sensor [px], (height, width), NaN where it has none.
        yardstick: of the sensor to compare it with.
        true: disparity.
    """
    from scipy.stats import spearmanr

    correlations = []
    for mine, other in zip(_blocks(disparity, true), _blocks(yardstick, true), strict=True):
        both = np.isfinite(mine) & np.isfinite(other)
        correlations.append(float(spearmanr(mine[both], other[both])[0]))  # pyright: ignore
    return correlations[0], correlations[1]


def _blocks(disparity: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the share of failed pixels of each block, and the RMS error of the others; NaN: none."""
    error = np.abs(disparity - true)
    in_both_eyes = np.isfinite(true) & (true <= np.arange(true.shape[1]) + 0.5)
    failed = np.where(in_both_eyes, ~(error <= WRONG), np.nan)
    square = np.where(in_both_eyes & (error <= WRONG), error**2, np.nan)
    return _block_means(failed), np.sqrt(_block_means(square))


def _block_means(values: np.ndarray) -> np.ndarray:
    rows, columns = (size // BLOCK for size in values.shape)
    blocks = values[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK)
    count = np.isfinite(blocks).sum(axis=(1, 3))
    with np.errstate(invalid="ignore"):
        return (np.nansum(blocks, axis=(1, 3)) / count).ravel()


def bad_share(disparity: np.ndarray, true: np.ndarray, where: np.ndarray) -> float:
    """Return the share of the values in ``where`` (bool) that are wrong by more than a pixel."""
    error = np.abs(disparity - true)[where]
    known = np.isfinite(error)
    return float((error[known] > WRONG).mean()) if known.any() else np.nan


def small_hole_share(disparity: np.ndarray, largest: int = SMALL_HOLE) -> float:
    """Return the share of the hole area in connected holes of up to ``largest`` pixels, 0 to 1."""
    import cv2

    holes = np.isnan(disparity).astype(np.uint8)
    if not holes.any():
        return 0.0
    sizes = cv2.connectedComponentsWithStats(holes, connectivity=8)[2][1:, cv2.CC_STAT_AREA]
    return float(sizes[sizes <= largest].sum() / sizes.sum())


def temporal_share(stack: np.ndarray, true: np.ndarray) -> float:
    """Return the share of the error's variance that changes between frames of a camera at rest, 0 to 1.

    Args:
        stack: disparity of the frames [px], (frames, height, width), NaN where there is none.
        true: disparity, (height, width).
    """
    error = stack - true
    error = error[:, np.isfinite(error).all(axis=0)]
    changing = error.var(axis=0, ddof=1).mean()
    return float(changing / np.mean(error**2))


def repeated_bad(stack: np.ndarray, true: np.ndarray) -> float:
    """Return the share of the bad pixels of a frame that are bad in the next; see `temporal_share`."""
    bad = np.abs(stack - true) > WRONG
    return float((bad[:-1] & bad[1:]).sum() / max(bad[:-1].sum(), 1))


def median_where_most(stack: np.ndarray) -> np.ndarray:
    """Return the median over frames, (height, width), NaN where no more than half of them have a value."""
    ordered = np.sort(stack, axis=0)  # NaN come last
    count = np.isfinite(stack).sum(axis=0)
    low, high = (np.maximum(count - 1, 0) // 2)[None], (count // 2)[None].clip(max=len(stack) - 1)
    middle = (np.take_along_axis(ordered, low, 0) + np.take_along_axis(ordered, high, 0))[0] / 2
    return np.where(count > len(stack) // 2, middle, np.nan)
