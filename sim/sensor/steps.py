"""Depth steps of a frame: where disparity jumps from one pixel to the next, and runs of marked pixels."""

from dataclasses import dataclass

import numpy as np

from sim.sensor.pixels import pixels_where


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


def find_steps(disparity: np.ndarray, threshold: float) -> Steps:
    """Return the jumps of more than ``threshold`` pixels along the rows; missing values have none."""
    jump = np.diff(disparity, axis=1)
    with np.errstate(invalid="ignore"):
        rows, left = pixels_where(np.abs(jump) > threshold)
    near_is_right = jump[rows, left] > 0
    return Steps(rows, left + near_is_right, left + ~near_is_right)


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
    height, width = marked.shape
    framed = np.zeros((height, width + 2), dtype=np.int8)
    framed[:, 1:-1] = marked
    change = np.diff(framed, axis=1)
    rows, first = pixels_where(change == 1)
    _, end = pixels_where(change == -1)
    return Runs(rows, first, end)
