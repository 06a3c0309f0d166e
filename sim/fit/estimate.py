"""Figures with standard errors: a statistic is computed again and again without one block of the image.

Errors of neighboring pixels are similar, so pixels are not independent; large blocks nearly are.
The delete-one jackknife (Efron and Stein 1981) gets the standard error of any smooth statistic from them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

# Blocks of an image, down and across: 24 of them, each wider than the static field is correlated.
ROWS, COLUMNS = 4, 6
BLOCKS = ROWS * COLUMNS


@dataclass(frozen=True)
class Estimate:
    """A measured value.

    Attributes:
        value: in the unit of the figure; NaN: not known.
        error: its standard error in the same unit; NaN: not known.
    """

    value: float
    error: float

    @property
    def is_known(self) -> bool:
        """Whether there is a value with an error."""
        return bool(np.isfinite(self.value) and np.isfinite(self.error))

    def root(self) -> "Estimate":
        """Return the square root of a variance; one below zero counts as zero."""
        value = float(np.sqrt(max(self.value, 0.0)))
        # The derivative is infinite at zero, where the root of the error bounds the root of the value.
        error = min(self.error / (2 * value), np.sqrt(self.error)) if value else np.sqrt(self.error)
        return Estimate(value, float(error))


UNKNOWN = Estimate(np.nan, np.nan)


def block_numbers(shape: tuple[int, int]) -> np.ndarray:
    """Return the number of the block that each pixel belongs to, (height, width), 0 to BLOCKS - 1."""
    rows, columns = (
        np.arange(size) * count // size for size, count in zip(shape, (ROWS, COLUMNS), strict=True)
    )
    return rows[:, None] * COLUMNS + columns


def block_sums(values: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """Return the sum of the finite ``values`` of each block, (BLOCKS,); shapes (height, width)."""
    known = np.isfinite(values)
    return np.bincount(blocks[known], values[known], BLOCKS)


def jackknife(sums: np.ndarray, statistic: Callable[[np.ndarray], float]) -> Estimate:
    """Return a statistic of sums over the whole image, with its standard error.

    Args:
        sums: of each block, (BLOCKS, n); a block without any pixel has zeros only and does not count.
        statistic: takes the sums over all blocks, (n,); NaN where it has no value.
    """
    sums = sums[np.any(sums != 0, axis=1)]
    total = sums.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = float(statistic(total)) if len(sums) else np.nan
        others = np.array([statistic(total - own) for own in sums])
    count = len(others)
    if count < 2:
        return Estimate(value, np.nan)
    return Estimate(
        value, float(np.sqrt((count - 1) / count * np.sum((others - others.mean()) ** 2)))
    )


def ratio(sums: np.ndarray) -> float:
    """Return the first sum over the second, for `jackknife`."""
    return sums[0] / sums[1]
