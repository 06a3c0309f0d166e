"""A plane in an image of disparity: a plane in space is affine there, d = a u + b v + c."""

from dataclasses import dataclass

import numpy as np

# Values farther from the plane than this are wrong matches or another surface [px], as in Middlebury's bad-1.
NEAR = 1.0

# Noise may be larger than that: values within this many standard deviations belong to the plane, too.
DEVIATIONS = 5.0

# Standard deviation of a normal distribution over its median absolute deviation.
OF_MAD = 1.4826

_ROUNDS = 12

# The first rounds look at every fourth pixel along each axis.
_STRIDE = 4


@dataclass(frozen=True, eq=False)
class Plane:
    """A fitted plane.

    Attributes:
        coefficients: a, b [px/px] and c [px], for pixel centers (u, v).
        limit: how far its own pixels may be from it [px].
        share: of the known pixels that are no farther, 0 to 1.
    """

    coefficients: np.ndarray
    limit: float
    share: float

    def disparity(self, shape: tuple[int, int]) -> np.ndarray:
        """Return the plane at every pixel [px], (height, width), float64."""
        a, b, c = self.coefficients
        return a * (np.arange(shape[1]) + 0.5) + b * (np.arange(shape[0])[:, None] + 0.5) + c


def fit_plane(disparity: np.ndarray) -> Plane | None:
    """Return the plane that most of the pixels lie on; None where fewer than 100 are known.

    Least absolute deviations by reweighting, so that other surfaces do not pull at it; then least squares
    over the pixels near it.

    Args:
        disparity: [px], (height, width), NaN where there is none.
    """
    few = disparity[::_STRIDE, ::_STRIDE]
    rows, columns = np.nonzero(np.isfinite(few))
    if len(rows) < 100:
        return None
    points = np.stack([_STRIDE * columns + 0.5, _STRIDE * rows + 0.5, np.ones(len(rows))], axis=1)
    values = few[rows, columns].astype(np.float64)
    weights, found = np.ones(len(values)), np.zeros(3)
    for _ in range(_ROUNDS):
        found = np.linalg.lstsq(points * weights[:, None], values * weights, rcond=None)[0]
        weights = 1 / np.sqrt(np.maximum(np.abs(values - points @ found), 1e-2))
    spread = OF_MAD * float(np.median(np.abs(values - points @ found)))
    limit = max(NEAR, DEVIATIONS * spread)
    residual = disparity - Plane(found, limit, 1.0).disparity(disparity.shape)
    near = np.abs(residual) <= limit
    rows, columns = np.nonzero(near)
    points = np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))], axis=1)
    # The correction to the rough plane: small numbers, so that float64 is plenty.
    change = np.linalg.solve(points.T @ points, points.T @ residual[near])
    return Plane(found + change, limit, float(near.sum() / np.isfinite(disparity).sum()))
