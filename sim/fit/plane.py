"""A plane in an image of disparity: a plane in space is affine there, d = a u + b v + c."""

from dataclasses import dataclass

import numpy as np

# Values farther from the plane than this are wrong matches or another surface [px], as in Middlebury's bad-1.
NEAR = 1.0

# Noise may be larger than that: values within this many standard deviations belong to the plane, too, up to a
# distance that no noise of a depth camera reaches [px].
DEVIATIONS, FAR = 5.0, 3.0

# Fewer pixels make no wall.
FEWEST = 500

# Standard deviation of a normal distribution over its median absolute deviation.
OF_MAD = 1.4826

# Planes through three random pixels that are tried, and pixels that judge each of them. One in eight lies
# on a wall that half of the image shows.
_DRAWS, _JUDGES = 200, 2000

# Least squares over the pixels near the plane, which then moves a little.
_ROUNDS = 3


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
    """Return the plane that most of the pixels lie on; None where too few are known.

    The least median of squares (Rousseeuw 1984) over random triplets, which other surfaces on up to half of
    the image do not move; then least squares over the pixels near it.

    Args:
        disparity: [px], (height, width), NaN where there is none.
    """
    at = np.flatnonzero(np.isfinite(disparity))
    if len(at) < FEWEST:
        return None
    rows, columns = np.divmod(at, disparity.shape[1])
    points = np.stack([columns + 0.5, rows + 0.5, np.ones(len(at))], axis=1)
    values = disparity.reshape(-1)[at].astype(np.float64)
    if np.linalg.matrix_rank(points - points.mean(axis=0)) < 2:  # all in a line
        return None
    found, spread = _by_least_median(points, values)
    limit = min(max(NEAR, DEVIATIONS * spread), FAR)
    near = np.abs(values - points @ found) <= limit
    for _ in range(_ROUNDS):
        inside, rest = points[near], values[near] - points[near] @ found
        # The correction to the rough plane: small numbers, so that float64 is plenty.
        found = found + np.linalg.lstsq(inside.T @ inside, inside.T @ rest, rcond=None)[0]
        near = np.abs(values - points @ found) <= limit
    return Plane(found, limit, float(near.mean()))


def _by_least_median(points: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the best of many planes through three pixels, and the standard deviation around it."""
    rng = np.random.default_rng(0)
    triplets = rng.integers(len(values), size=(_DRAWS, 3))
    triplets = triplets[np.abs(np.linalg.det(points[triplets])) > 1]  # not in a line
    planes = np.linalg.solve(points[triplets], values[triplets][..., None])[..., 0]
    judges = rng.integers(len(values), size=_JUDGES)
    medians = np.median(np.abs(values[judges] - planes @ points[judges].T), axis=1)
    best = int(np.argmin(medians))
    return planes[best], OF_MAD * float(medians[best])
