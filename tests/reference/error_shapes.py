"""Shapes of disparity errors, and how often a stated confidence is right, for tests of the default sensor."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from digs_warp.sim.sensor.error_attribution import WRONG


def small_error_rms(disparity: np.ndarray, true: np.ndarray) -> float:
    """Return the RMS of the errors of up to a pixel [px]; NaN: there are none."""
    error = np.abs(disparity - true)
    small = error[error <= WRONG]
    return float(np.sqrt(np.mean(small**2))) if len(small) else np.nan


def autocorrelation(disparity: np.ndarray, true: np.ndarray, lag: int, axis: int) -> float:
    """Return the correlation of errors of up to a pixel that are ``lag`` pixels apart, -1 to 1.

    Args:
        disparity: of a sensor [px], (height, width), NaN where it has none.
        true: disparity.
        lag: [px], >= 1.
        axis: 0: one below the other; 1: side by side.
    """
    error = disparity - true
    error[~(np.abs(error) <= WRONG)] = np.nan
    error = np.moveaxis(error - np.nanmean(error), axis, 0)
    return float(np.nanmean(error[lag:] * error[:-lag]) / np.nanmean(error**2))


def failure_runs(disparity: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return the lengths along the rows of what is missing or wrong [px], one for each run, (runs,)."""
    failed = np.isfinite(true) & ~(np.abs(disparity - true) <= WRONG)
    ends = np.diff(np.pad(failed, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    return np.nonzero(ends == -1)[1] - np.nonzero(ends == 1)[1]


@dataclass(frozen=True)
class Trust:
    """The matches whose confidence is in a range.

    Attributes:
        low, high: ends of the range, the upper one exclusive.
        count: of the matches, > 0.
        confidence: mean.
        right: share that is right.
    """

    low: float
    high: float
    count: int
    confidence: float
    right: float


def reliability(confidence: np.ndarray, right: np.ndarray, edges: Sequence[float]) -> list[Trust]:
    """Return how often matches are right, range by range; those without matches are left out.

    Args:
        confidence: of every match, (n,), 0 to 1.
        right: which of them are right, (n,), bool.
        edges: of the ranges, rising; the last is inclusive.
    """
    found = []
    for low, high in pairwise(edges):
        there = (confidence >= low) & (confidence < high)
        if high == edges[-1]:
            there |= confidence == high
        if there.any():
            means = float(confidence[there].mean()), float(right[there].mean())
            found.append(Trust(low, high, int(there.sum()), *means))
    return found
