"""Random fields over a whole image, white or smooth over a given distance, with mean 0 and variance 1."""

from functools import cache

import numpy as np

from digs_warp.sim.sensor.filters import enlarge, separable

# Standard deviation and mean of a byte.
BYTE_SIGMA = np.sqrt((256**2 - 1) / 12)
BYTE_MEAN = 127.5

# Smooth fields are drawn on a coarse grid with this many points per correlation length.
GRID_POINTS = 5.0

# Gaussians are cut off here, in standard deviations; 0.3 % of their sum is lost.
KERNEL_REACH = 3.0


def drawn_quantiles(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return numbers of `normal_quantiles`, drawn independently and uniformly, (count,), uint16.

    The quantiles with these numbers are white noise, several times as fast as ``rng.standard_normal``.
    """
    return random_bytes(rng, 2 * count).view(np.uint16)


@cache
def normal_quantiles() -> np.ndarray:
    """Return the quantiles (i + 0.5) / 2^16 of a normal distribution, scaled to variance 1, float32.

    No value exceeds 4.3: enough for noise that ends up in 8-bit steps.
    """
    from scipy.special import ndtri

    quantiles = ndtri((np.arange(1 << 16) + 0.5) / (1 << 16))
    return (quantiles / quantiles.std()).astype(np.float32)


def random_bytes(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return bytes, shape (count,), uint8, straight from the generator's 64-bit words.

    Several times as fast as ``rng.bytes``.
    """
    return rng.bit_generator.random_raw(-(-count // 8)).view(np.uint8)[:count]


def smooth_normal(
    rng: np.random.Generator,
    shape: tuple[int, int],
    correlation: float,
    vertical_correlation: float | None = None,
) -> np.ndarray:
    """Return a normal field whose correlation falls to 1/e at ``correlation`` pixels, float32.

    White noise blurred by a Gaussian of s pixels has the correlation exp(-r^2 / (4 s^2)): 1/e at 2 s. The
    white noise is bytes, ten times as fast to draw as normal numbers; the Gaussian averages 4 pi s^2 of them,
    enough for a normal sum (excess kurtosis -1.2 / (4 pi s^2)).

    Args:
        rng: draws the field.
        shape: (height, width).
        correlation: along rows [px], >= 1.5.
        vertical_correlation: along columns [px], >= 1.5; default: the same.
    """
    vertical = vertical_correlation or correlation
    step, vertical_step = _grid_step(correlation), _grid_step(vertical)
    if step > 1 or vertical_step > 1:
        coarse = (shape[0] // vertical_step + 2, shape[1] // step + 2)
        field = smooth_normal(rng, coarse, correlation / step, vertical / vertical_step)
        stretched = enlarge(field, (coarse[0] * vertical_step, coarse[1] * step))
        return stretched[vertical_step:, step:][: shape[0], : shape[1]]
    across, down = _kernel(correlation), _kernel(vertical)
    left, top = len(across) // 2, len(down) // 2
    # With a margin, so that every pixel averages the same number of bytes.
    height, width = shape[0] + 2 * top, shape[1] + 2 * left
    noise = random_bytes(rng, height * width).reshape(height, width)
    across /= BYTE_SIGMA
    field = separable(noise, across, down, -BYTE_MEAN * float(across.sum() * down.sum()))
    return field[top : top + shape[0], left : left + shape[1]]


def _grid_step(correlation: float) -> int:
    """Return the distance of grid points [px] at which linear interpolation loses 1 % of the variance."""
    return max(1, int(correlation / GRID_POINTS))


def _kernel(correlation: float) -> np.ndarray:
    """Return a Gaussian whose squares sum to 1: it keeps the variance of white noise."""
    sigma = 0.5 * correlation
    reach = int(np.ceil(KERNEL_REACH * sigma))
    kernel = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) / sigma))
    return kernel / np.linalg.norm(kernel)
