"""What every splat file needs: whole numbers checked, broken rows found, opacities off the ends."""

import logging

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import FIELDS, Gaussians

logger = logging.getLogger(__name__)

# The logit of opacity 0 and 1, which files may hold and float32 cannot compute with: at 40 the logistic
# function is 1 to the last bit of float32.
LARGEST_LOGIT = 40.0

# A standard deviation of 0 makes the covariance singular; this one is smaller than any splat [m].
SMALLEST_SCALE = 1e-12

# Half of the distance from the last step of an 8-bit opacity (0 and 255) to its neighbour's boundary:
# between the end and this far from it every value has the same code.
OPACITY_CODE_MARGIN = 0.25


def logits_from_codes(codes: np.ndarray) -> np.ndarray:
    """Return finite opacity logits, float32, of 8-bit opacities; encoded again they give the same codes."""
    steps = np.clip(codes.astype(np.float64), OPACITY_CODE_MARGIN, 255 - OPACITY_CODE_MARGIN)
    return (np.log(steps) - np.log(255 - steps)).astype(np.float32)


def codes_from_logits(logits: np.ndarray) -> np.ndarray:
    """Return opacities as 0..255, uint8, rounded to the nearest."""
    return np.rint(255.0 / (1.0 + np.exp(-logits.astype(np.float64).clip(-700, 700)))).astype(
        np.uint8
    )


def finite_rows(gaussians: Gaussians) -> np.ndarray:
    """Return which Gaussians hold finite values only, shape (n,), bool."""
    finite = np.ones(len(gaussians), dtype=bool)
    for name in FIELDS:
        values = np.isfinite(getattr(gaussians, name))
        if not values.all():
            finite &= values.all(axis=tuple(range(1, values.ndim)))
    return finite


def without_broken_rows(gaussians: Gaussians, what: str, drop_broken: bool) -> Gaussians:
    """Return Gaussians whose values are all finite.

    Args:
        gaussians: as read.
        what: names the file in messages.
        drop_broken: leave out rows with NaN or infinite values, with a logged warning.

    Raises:
        DigsError: there are such rows, and they are not to be dropped.
    """
    finite = finite_rows(gaussians)
    if finite.all():
        return gaussians
    broken = len(gaussians) - int(np.count_nonzero(finite))
    found = f"{broken} of {len(gaussians)} Gaussians hold NaN or infinite values"
    if not drop_broken:
        raise DigsError(
            f"{what}: {found} (the first is number {np.argmin(finite)}); "
            "add --drop-broken to leave them out"
        )
    logger.warning("%s: %s; they are left out", what, found)
    return gaussians.select(finite)


def check_writable(gaussians: Gaussians, what: str) -> None:
    """Raise a `DigsError` when Gaussians hold NaN or infinite values."""
    finite = finite_rows(gaussians)
    if not finite.all():
        raise DigsError(
            f"{what}: {np.count_nonzero(~finite)} of {len(gaussians)} Gaussians hold NaN or infinite "
            f"values (the first is number {np.argmin(finite)}); nothing was written"
        )


def warn_of_loss(count: int, total: int, what: str, loss: str) -> None:
    """Log that a format could not hold ``count`` of ``total`` Gaussians as they are."""
    if count:
        logger.warning("%s: %d of %d Gaussians %s", what, count, total, loss)
