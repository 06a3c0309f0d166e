"""Depth steps of a frame: where disparity jumps from one pixel to the next, and runs of marked pixels."""

from dataclasses import dataclass

import numpy as np

from digs_warp.sim.sensor.arrays import launch_rows, shared
from digs_warp.sim.sensor.slope_kernels import step_kernel


@dataclass(frozen=True, eq=False)
class Steps:
    """Places where disparity jumps between two neighbours along the last axis; all shapes (n,).

    Attributes:
        rows: row of the pair.
        near: column of the nearer pixel.
        far: column of the farther pixel, next to ``near``.
    """

    rows: np.ndarray
    near: np.ndarray
    far: np.ndarray

    @property
    def away(self) -> np.ndarray:
        """Direction from the nearer to the farther pixel, +1 or -1."""
        return self.far - self.near


def find_steps(disparity: np.ndarray, threshold: float) -> tuple[Steps, Steps]:
    """Return the jumps of more than ``threshold`` pixels along the rows, and those along the columns.

    Each in reading order along its axis; missing values have none. Along columns, ``Steps`` has rows and
    columns exchanged, as the steps of the transposed image.

    Args:
        disparity: [px], (height, width), float32, NaN where there is nothing.
        threshold: [px], >= 0.
    """
    height, width = disparity.shape
    marks = np.empty((height, width), dtype=np.uint8)
    launch_rows(step_kernel, height, [shared(disparity), height, width, threshold, shared(marks)])
    at, values = np.flatnonzero(marks.view(bool)), disparity.reshape(-1)
    here, limit = values[at], np.float32(threshold)
    right = values[np.minimum(at + 1, values.size - 1)] - here
    under = values[np.minimum(at + width, values.size - 1)] - here
    sideways = at[(np.abs(right) > limit) & (at % width < width - 1)]
    downward = at[(np.abs(under) > limit) & (at < values.size - width)]
    rows, left = np.divmod(sideways, width)
    # Reading order of the transposed image: column by column.
    columns, top = np.divmod(np.sort(downward % width * height + downward // width), height)
    above = top * width + columns
    return (
        _steps(rows, left, values[sideways + 1] > values[sideways]),
        _steps(columns, top, values[above + width] > values[above]),
    )


def _steps(rows: np.ndarray, first: np.ndarray, near_is_second: np.ndarray) -> Steps:
    """Return the steps between a pixel and the one after it."""
    return Steps(rows, first + near_is_second, first + ~near_is_second)


@dataclass(frozen=True, eq=False)
class Runs:
    """Maximal runs of marked pixels along the rows; all shapes (n,).

    Attributes:
        rows: of each run.
        first: first marked column.
        end: column after the last marked one; may be the width of the image.
    """

    rows: np.ndarray
    first: np.ndarray
    end: np.ndarray

    @property
    def lengths(self) -> np.ndarray:
        """Number of pixels of each run."""
        return self.end - self.first

    def pixels(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return row, column and number of its run of every pixel in the runs, each shape (m,)."""
        run = np.repeat(np.arange(len(self.rows)), self.lengths)
        before = np.cumsum(self.lengths) - self.lengths
        columns = np.arange(len(run)) - before[run] + self.first[run]
        return self.rows[run], columns, run


def find_runs(marked: np.ndarray) -> Runs:
    """Return the runs of True in each row of a (height, width) mask, in reading order."""
    width = marked.shape[1]
    at = np.flatnonzero(marked)
    if len(at) == 0:
        return Runs(at, at, at)
    # A run ends where the next marked pixel is another one than the next pixel, or in another row.
    ends = np.flatnonzero((np.diff(at) != 1) | (at[1:] % width == 0))
    first = at[np.concatenate(([0], ends + 1))]
    rows, columns = np.divmod(first, width)
    lengths = at[np.append(ends, len(at) - 1)] + 1 - first
    return Runs(rows, columns, columns + lengths)
