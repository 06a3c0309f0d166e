"""How much brighter and how differently tinted one image of a scene is than another.

Automatic exposure and white balance multiply each channel of the light by a gain g. In sRGB (IEC 61966-2-1)
that is a factor, too, above the darkest values: from x = 1.055 L^(1/2.4) - 0.055 follows

    y + 0.055 = s (x + 0.055),   s = g^(1/2.4)

so one number for each channel describes both, and least squares give it in closed form. A camera whose
contrast or black level changes, too, adds a lift to it (`digs_warp.measure.color_lift`).
"""

from dataclasses import dataclass

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


@dataclass(frozen=True, eq=False)
class ColorGain:
    """Gains of red, green and blue, and a lift of all three.

    Attributes:
        log_factors: logarithms of the factors s on sRGB + 0.055, shape (3,).
        lift: what is added to the sRGB values after that.
    """

    log_factors: np.ndarray
    lift: float = 0.0

    @property
    def stops(self) -> np.ndarray:
        """Logarithms to base 2 of the gains on linear light, shape (3,)."""
        return STOPS_PER_LOG * self.log_factors

    def applied(self, colors: np.ndarray) -> np.ndarray:
        """Return sRGB colors, shape (..., 3), after gain and lift; not clipped."""
        return np.exp(self.log_factors) * (colors + OFFSET) - OFFSET + self.lift

    def removal(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (factor, shift), shape (3,) each: ``factor * color + shift`` undoes `applied`."""
        factor = np.exp(-self.log_factors)
        return factor, OFFSET * (factor - 1.0) - factor * self.lift


def fit_color_gain(
    colors: np.ndarray,
    photograph: np.ndarray,
    otherwise: np.ndarray | None = None,
    lift: float = 0.0,
) -> ColorGain:
    """Return the gain that turns ``colors`` into ``photograph``, by robust least squares.

    Args:
        colors: sRGB values without the gain, shape (n, 3).
        photograph: sRGB values in 0..1 of the same pixels, shape (n, 3).
        otherwise: log factors (3,) of channels that too few pixels tell about, being black, saturated or
            not finite. Default: 0, no gain.
        lift: of the photograph, known; it is taken off before.
    """
    factors = np.zeros(3) if otherwise is None else np.array(otherwise, dtype=np.float64)
    limit = MOST_STOPS / STOPS_PER_LOG
    for channel in range(3):
        x = np.asarray(colors[:, channel], dtype=np.float64)
        y = np.asarray(photograph[:, channel], dtype=np.float64)
        usable = np.isfinite(x) & (x > DARK) & (y > DARK) & (y < SATURATED / 255.0)
        if np.count_nonzero(usable) >= FEWEST_PIXELS:
            below = y[usable] if lift == 0 else np.maximum(y[usable] - lift, 0.0)
            factor = _robust_factor(x[usable] + OFFSET, below + OFFSET)
            factors[channel] = np.clip(np.log(factor), -limit, limit)
    return ColorGain(factors, lift)


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
