"""Shapes of disparity errors, for tests of the default sensor."""

import numpy as np

from digs_warp.sim.sensor.error_attribution import WRONG


def small_error_rms(disparity: np.ndarray, true: np.ndarray) -> float:
    """Return the RMS of the errors of up to a pixel [px]; NaN: there are none."""
    error = np.abs(disparity - true)
    small = error[error <= WRONG]
    return float(np.sqrt(np.mean(small**2))) if len(small) else np.nan


def autocorrelation(disparity: np.ndarray, true: np.ndarray, lag: int, axis: int) -> float:
    """Return the correlation of errors of up to a pixel that are ``lag`` pixels apart along an axis."""
    error = disparity - true
    error[~(np.abs(error) <= WRONG)] = np.nan
    error = np.moveaxis(error - np.nanmean(error), axis, 0)
    return float(np.nanmean(error[lag:] * error[:-lag]) / np.nanmean(error**2))


def failure_runs(disparity: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return the lengths along the rows of what is missing or wrong [px], one for each run, (runs,)."""
    failed = np.isfinite(true) & ~(np.abs(disparity - true) <= WRONG)
    ends = np.diff(np.pad(failed, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    return np.nonzero(ends == -1)[1] - np.nonzero(ends == 1)[1]
