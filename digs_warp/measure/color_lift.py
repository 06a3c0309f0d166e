"""How much lighter all values of one image are than those of another, beside its gain.

Not every camera is an sRGB camera with another exposure: with the light, it may change its contrast, its
black level, or the veil of stray light over the image. Next to a factor for each channel, one number for all
channels explains most of that in matched pixels of real recordings:

    y + 0.055 = s (x + 0.055) + l

A straight line through sRGB values is also what the training takes off a photograph at no further cost.
"""

import numpy as np

from digs_warp.measure.color_gain import (
    DARK,
    DEVIATION_PER_MEDIAN,
    FEWEST_PIXELS,
    HUBER,
    LEAST_DEVIATION,
    OFFSET,
    ROUNDS,
    SATURATED,
    median,
)

# Lifts of photographs of constant tone come out this large, root mean square: 0.008 from matched pixels of
# the cow "spot" of the sample data, 0.003 after 300 steps of training.
NOISE_LIFT = 0.01
# The largest lift: beyond it, a photograph is nearly gray.
MOST_LIFT = 0.2
# Of values that hardly vary, nobody can tell a lift from a gain: what a gain cannot explain of a constant has
# to be this share of it. Values that vary by 6% of their mean have it.
LEAST_SHARE = 0.004


def fit_lift(colors: np.ndarray, photograph: np.ndarray, otherwise: float = 0.0) -> float:
    """Return the lift l that, with a gain of each channel, turns ``colors`` into ``photograph``.

    Robust least squares over the four unknowns, of which the gains are eliminated.

    Args:
        colors: sRGB values without gain and lift, shape (n, 3).
        photograph: sRGB values in 0..1 of the same pixels, shape (n, 3).
        otherwise: where too few pixels tell it, or too little contrast.
    """
    x, y = np.asarray(colors, np.float64), np.asarray(photograph, np.float64)
    usable = np.isfinite(x) & (x > DARK) & (y > DARK) & (y < SATURATED / 255.0)
    if np.count_nonzero(usable) < FEWEST_PIXELS:
        return otherwise
    x, y = np.where(usable, x, 0.0) + OFFSET, np.where(usable, y, 0.0) + OFFSET
    weights, lift = usable.astype(np.float64), 0.0
    for _ in range(ROUNDS):
        # Sums, not products of matrices: those depend on the number of threads.
        squares = np.maximum((weights * x * x).sum(axis=0), 1e-12)
        left = 1.0 - x * ((weights * x).sum(axis=0) / squares)
        power = float((weights * left * left).sum())
        if power < LEAST_SHARE * float(weights.sum()):
            return otherwise
        lift = float((weights * left * y).sum()) / power
        factors = (weights * x * (y - lift)).sum(axis=0) / squares
        residuals = np.abs(y - lift - factors * x)
        deviation = DEVIATION_PER_MEDIAN * median(residuals[usable])
        allowed = HUBER * max(deviation, LEAST_DEVIATION)
        weights = usable * (allowed / np.maximum(residuals, allowed))
    return float(np.clip(lift, -MOST_LIFT, MOST_LIFT))


def trusted_share(square: float, error: float) -> float:
    """Return the share of lifts, or gains, that their errors do not explain, 0 to 1 (James and Stein).

    Args:
        square: their mean square.
        error: that of their errors, above 0.
    """
    return 1.0 - error / max(square, error)


def trusted_lift(colors: np.ndarray, photograph: np.ndarray) -> float:
    """Return the lift of one photograph, as far as its errors do not explain it."""
    lift = fit_lift(colors, photograph)
    return trusted_share(lift**2, NOISE_LIFT**2) * lift
