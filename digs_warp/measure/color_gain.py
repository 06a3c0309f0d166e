"""How much brighter and how differently tinted one image of a scene is than another.

Automatic exposure and white balance multiply each channel of the light by a gain g. In sRGB (IEC 61966-2-1)
that is a factor, too, above the darkest values: from x = 1.055 L^(1/2.4) - 0.055 follows

    y + 0.055 = s (x + 0.055),   s = g^(1/2.4)

so one number for each channel describes both. `fit_color_gain` finds the gain between two images of the same
pixels; `joint_log_factors` those of many photographs that see the same points, all at once.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

# Of the sRGB curve: the offset, the exponent, and where its linear part at the dark end stops.
OFFSET = 0.055
EXPONENT = 2.4
DARK = 0.04045

# Stops (factors of 2 on linear light) for each unit of log s.
STOPS_PER_LOG = EXPONENT / float(np.log(2.0))

# 8-bit values from here on may have been clipped, noise included, and tell only a lower bound.
SATURATED = 250

# The fewest pixels that a channel is judged by.
FEWEST_PIXELS = 16
# Largest gain [stops]: beyond it a photograph is black or white.
MOST_STOPS = 4.0
# Residuals above this many standard deviations weigh less (Huber), after the deviation that the median of
# absolute residuals gives for normal noise.
HUBER = 1.345
DEVIATION_PER_MEDIAN = 1.4826
# That of rounding to 8 bits.
LEAST_DEVIATION = 1.0 / (255.0 * 12.0**0.5)
ROUNDS = 4

# Rounds of reweighting: highlights, and what hides a point, hardly count. A difference that is larger than
# usual weighs less by the square of that, so that it pulls the less, the larger it is: where one photograph
# shows a highlight and the next one none, it would pull both together.
JOINT_ROUNDS = 12
# The last round is the first one that changes no logarithm by more: 0.0014 stops.
SETTLED = 1e-3
# Misfit at which the equations of a round are solved, relative to the weights of the photographs.
SOLVED = 1e-11
# Usual are differences up to this many median ones, and all below about two steps of 8 bits.
USUAL, LEAST = 2.0, 0.02


@dataclass(frozen=True, eq=False)
class ColorGain:
    """Gains of red, green and blue.

    Attributes:
        log_factors: logarithms of the factors s on sRGB + 0.055, shape (3,).
    """

    log_factors: np.ndarray

    @property
    def stops(self) -> np.ndarray:
        """Logarithms to base 2 of the gains on linear light, shape (3,)."""
        return STOPS_PER_LOG * self.log_factors

    def applied(self, colors: np.ndarray) -> np.ndarray:
        """Return sRGB colors, shape (..., 3), after the gain; not clipped."""
        return np.exp(self.log_factors) * (colors + OFFSET) - OFFSET

    def removal(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (factor, shift), shape (3,) each: ``factor * color + shift`` undoes `applied`."""
        factor = np.exp(-self.log_factors)
        return factor, OFFSET * (factor - 1.0)


def fit_color_gain(
    colors: np.ndarray, photograph: np.ndarray, otherwise: np.ndarray | None = None
) -> ColorGain:
    """Return the gain that turns ``colors`` into ``photograph``, by robust least squares.

    Args:
        colors: sRGB values without the gain, shape (n, 3).
        photograph: sRGB values in 0..1 of the same pixels, shape (n, 3).
        otherwise: log factors (3,) of channels that too few pixels tell about, being black, saturated or
            not finite. Default: 0, no gain.
    """
    factors = np.zeros(3) if otherwise is None else np.array(otherwise, dtype=np.float64)
    limit = MOST_STOPS / STOPS_PER_LOG
    for channel in range(3):
        x = np.asarray(colors[:, channel], dtype=np.float64)
        y = np.asarray(photograph[:, channel], dtype=np.float64)
        usable = np.isfinite(x) & (x > DARK) & (y > DARK) & (y < SATURATED / 255.0)
        if np.count_nonzero(usable) >= FEWEST_PIXELS:
            factor = _robust_factor(x[usable] + OFFSET, y[usable] + OFFSET)
            factors[channel] = np.clip(np.log(factor), -limit, limit)
    return ColorGain(factors)


def _robust_factor(x: np.ndarray, y: np.ndarray) -> float:
    """Return s that minimizes the Huber loss of y - s x; all values are above 0."""
    factor = median(y / x)
    for _ in range(ROUNDS):
        residuals = np.abs(y - factor * x)
        deviation = DEVIATION_PER_MEDIAN * median(residuals)
        allowed = HUBER * max(deviation, LEAST_DEVIATION)
        weights = allowed / np.maximum(residuals, allowed)
        weighted = weights * x
        # Sums, not products of vectors: those depend on the number of threads.
        factor = float((weighted * y).sum() / (weighted * x).sum())
    return factor


def median(values: np.ndarray) -> float:
    """Return the median of finite values (n,), at least one.

    As NumPy's, which also looks for NaN and takes four times as long: all cores wait for it in every step.
    """
    half = len(values) // 2
    parted = np.partition(values, half)
    upper = float(parted[half])
    return upper if len(values) % 2 else (float(parted[:half].max()) + upper) / 2


def joint_log_factors(values: np.ndarray) -> np.ndarray:
    """Return the logarithms of the factors of m photographs, shape (m,); their mean is 0.

    A photograph that shares no point with another has 0.

    Args:
        values: one channel of n points, sRGB in 0..1, NaN where a point is not seen, shape (n, m).
    """
    from scipy.sparse import csr_array

    with np.errstate(invalid="ignore"):
        told = (values > DARK) & (values < SATURATED / 255.0)
    told &= told.sum(axis=1, keepdims=True) >= 2
    count = values.shape[1]
    if not told.any():
        return np.zeros(count)
    # Only where a photograph tells a point, one point after the other: that is a third of all.
    point, photo = np.nonzero(told[told.any(axis=1)])
    starts = np.flatnonzero(np.diff(point, prepend=-1))
    rows = np.append(starts, len(point))

    def sums(each: np.ndarray) -> np.ndarray:
        return np.add.reduceat(each, starts)[point]

    light = values[told] + OFFSET
    logs, usual = np.log(light), light**2  # an error of y is one of log y times y
    weights, found = usual, np.zeros(count)
    for _ in range(JOINT_ROUNDS):
        totals = sums(weights)
        shares = weights / totals
        apart = logs - sums(shares * logs)
        roots = csr_array((weights / np.sqrt(totals), photo, rows), shape=(len(starts), count))
        before = found
        own, right = (np.bincount(photo, each, count) for each in (weights, weights * apart))
        found = _without_points(roots, own, right, before)
        if np.abs(found - before).max() < SETTLED:
            break
        even = logs - found[photo]
        misses = light * np.abs(even - sums(shares * even))
        allowed = max(USUAL * float(np.median(misses)), LEAST)
        weights = usual * (allowed / np.maximum(misses, allowed)) ** 2
    return found - found.mean()


def _without_points(
    roots: Any, own: np.ndarray, right: np.ndarray, start: np.ndarray
) -> np.ndarray:
    """Solve (diag(own) - roots^T roots) x = right, the normal equations without the points.

    By conjugate gradients, a dozen or two steps: a matrix would grow with the square of the photographs.
    Where it is singular, as nobody knows the common exposure, the solution nearest to ``start`` is found.

    Args:
        roots: a sparse matrix, shape (n, m).
        own: shape (m,).
        right: in the range of the matrix, shape (m,).
        start: to improve, shape (m,).
    """
    across = roots.T

    def times(x: np.ndarray) -> np.ndarray:
        return own * x - across @ (roots @ x)

    found, goal = start, SOLVED**2 * (own**2).sum()
    left = right - times(found)
    way, square = left, (left**2).sum()  # sums, not products: those depend on the number of threads
    for _ in range(4 * len(own)):
        if square <= goal:
            break
        ahead = times(way)
        step = square / (way * ahead).sum()
        found, left = found + step * way, left - step * ahead
        before, square = square, (left**2).sum()
        way = left + square / before * way
    return found


def trusted_share(square: float, error: float) -> float:
    """Return the share of gains that their errors do not explain, 0 to 1 (James and Stein).

    Args:
        square: their mean square.
        error: that of their errors, above 0.
    """
    return 1.0 - error / max(square, error)
