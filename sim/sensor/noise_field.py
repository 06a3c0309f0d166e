"""Random fields over a whole image, smooth over a given distance, of mean 0 and variance 1."""

import numpy as np

from sim.sensor.filters import enlarge, separable

# Standard deviation and mean of a byte.
BYTE_SIGMA = np.sqrt((256**2 - 1) / 12)
BYTE_MEAN = 127.5

# A Gaussian ends here, in its standard deviations; what is cut off holds 0.3 % of its sum.
KERNEL_REACH = 3.0


def smooth_normal(
    rng: np.random.Generator, shape: tuple[int, int], correlation: float
) -> np.ndarray:
    """Return a normal field whose correlation falls to 1/e at ``correlation`` pixels, float32.

    White noise under a Gaussian of s pixels is correlated as exp(-r^2 / (4 s^2)): 1/e at 2 s. The white
    noise is bytes, ten times as fast to draw as normal numbers; the Gaussian averages so many of them
    (4 pi s^2) that the sum is normal (excess kurtosis -1.2 / (4 pi s^2)).

    Args:
        rng: draws the field.
        shape: (height, width).
        correlation: [px], >= 2.
    """
    sigma = 0.5 * correlation
    reach = int(np.ceil(KERNEL_REACH * sigma))
    offsets = np.arange(-reach, reach + 1)
    kernel = np.exp(-0.5 * np.square(offsets / sigma))
    kernel /= np.sqrt(np.sum(np.square(kernel)) * BYTE_SIGMA)  # both axes together: variance 1
    # A frame wide enough that every pixel averages the same number of bytes.
    height, width = shape[0] + 2 * reach, shape[1] + 2 * reach
    noise = np.frombuffer(rng.bytes(height * width), np.uint8).reshape(height, width)
    field = separable(noise, kernel, -BYTE_MEAN * float(kernel.sum()) ** 2)
    return field[reach : reach + shape[0], reach : reach + shape[1]]


def patchy_uniform(rng: np.random.Generator, shape: tuple[int, int], cell: float) -> np.ndarray:
    """Return a field uniform over 0 to 1 that hardly changes over ``cell`` pixels, float32.

    Thresholding it gives patches instead of single pixels. It is computed on a coarse grid and enlarged.
    """
    from scipy.special import ndtr

    # Three grid points per cell: the linear steps between them stay small.
    step = max(1.0, cell / 3)
    coarse = (int(np.ceil(shape[0] / step)) + 1, int(np.ceil(shape[1] / step)) + 1)
    return enlarge(ndtr(smooth_normal(rng, coarse, max(2.0, cell / step))), shape)
