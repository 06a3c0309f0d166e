"""Random fields over an image with mean 0 and variance 1: white, smooth over a distance, or of octaves."""

from functools import cache

import numpy as np

from digs_warp.sim.camera.rig import SHORTEST_CORRELATION
from digs_warp.sim.sensor.filters import enlarge, separable

# Standard deviation and mean of a byte.
BYTE_SIGMA = np.sqrt((256**2 - 1) / 12)
BYTE_MEAN = 127.5

# Gaussians are cut off here, in standard deviations; 0.3 % of their sum is lost.
KERNEL_REACH = 3.0


def white_normal(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Return white normal noise, float32, several times as fast as ``rng.standard_normal``."""
    count = int(np.prod(shape))
    return _normal_quantiles().take(random_bytes(rng, 2 * count).view(np.uint16)).reshape(shape)


@cache
def _normal_quantiles() -> np.ndarray:
    """Return the quantiles (i + 0.5) / 2^16, up to 4.3: enough for noise that ends up in 8-bit steps."""
    from scipy.special import ndtri

    quantiles = ndtri((np.arange(1 << 16) + 0.5) / (1 << 16))
    return (quantiles / quantiles.std()).astype(np.float32)


def random_bytes(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return bytes, shape (count,), uint8, straight from the generator's 64-bit words.

    Several times as fast as ``rng.bytes``.
    """
    return rng.bit_generator.random_raw(-(-count // 8)).view(np.uint8)[:count]


# Each octave of `octave_normal` has this share of the amplitude of the next coarser one [tuned: residuals of
# a D435, a D4xx and a D455 to a plane in windows of 8 to 64 px].
PERSISTENCE = 0.5


def octave_normal(
    rng: np.random.Generator, shape: tuple[int, int], correlation: float
) -> np.ndarray:
    """Return a sum of octaves of smooth normal noise, of variance 1, (height, width), float32.

    Each octave has half the correlation length of the one before, down to 1.5 to 3 px: the spectrum of the
    errors of depth cameras, whose residuals grow with the window. It is drawn from coarse to fine, each
    octave on its own grid, which takes a third more time than the finest octave alone.

    Args:
        rng: draws the field.
        shape: (height, width).
        correlation: of the coarsest octave [px], >= 1.5; 0: white noise.
    """
    if correlation == 0:
        return rng.standard_normal(shape, dtype=np.float32)
    octaves = int(np.log2(correlation / SHORTEST_CORRELATION)) + 1
    finest = correlation / 2 ** (octaves - 1)
    amplitudes = PERSISTENCE ** np.arange(octaves, dtype=np.float64)  # the coarsest first
    kept = [_kept_variance(finest, octaves - 1 - k) for k in range(octaves)]
    amplitudes /= np.sqrt(np.sum(amplitudes**2 * kept))
    field = np.zeros((1, 1), np.float32)
    for k, amplitude in enumerate(amplitudes):
        size = 2 ** (octaves - 1 - k)
        height, width = (-(-side // size) for side in shape)
        octave = smooth_normal(rng, (height, width), finest)
        octave = octave * np.float32(amplitude)
        if k > 0:
            coarser = enlarge(field, (2 * field.shape[0], 2 * field.shape[1]))
            octave += coarser[:height, :width]
        field = octave
    return field


@cache
def _kept_variance(correlation: float, doublings: int) -> float:
    """Return the variance that smooth noise of variance 1 has after linear enlargements by two."""
    weights = np.eye(16, dtype=np.float32)
    for _ in range(doublings):
        weights = enlarge(weights, (2 * weights.shape[0], 16))
    inner = weights[len(weights) // 4 : -len(weights) // 4].astype(np.float64)
    distance = np.subtract.outer(np.arange(16), np.arange(16))
    along = np.einsum("ni,ij,nj->n", inner, np.exp(-np.square(distance / correlation)), inner)
    return float(along.mean() ** 2)  # rows and columns


def smooth_normal(
    rng: np.random.Generator, shape: tuple[int, int], correlation: float
) -> np.ndarray:
    """Return a normal field whose correlation falls to 1/e at ``correlation`` pixels, float32.

    White noise blurred by a Gaussian of s pixels has the correlation exp(-r^2 / (4 s^2)): 1/e at 2 s. The
    white noise is bytes, ten times as fast to draw as normal numbers; the Gaussian averages 4 pi s^2 of them,
    enough for a normal sum (excess kurtosis -1.2 / (4 pi s^2)).

    Args:
        rng: draws the field.
        shape: (height, width).
        correlation: [px], >= 1.5. The time grows with it: of larger ones, enlarge a smaller field.
    """
    kernel = _kernel(correlation)
    margin = len(kernel) // 2
    # So that every pixel averages the same number of bytes.
    height, width = shape[0] + 2 * margin, shape[1] + 2 * margin
    noise = random_bytes(rng, height * width).reshape(height, width)
    across = kernel / BYTE_SIGMA
    field = separable(noise, across, kernel, -BYTE_MEAN * float(across.sum() * kernel.sum()))
    return field[margin : margin + shape[0], margin : margin + shape[1]]


def _kernel(correlation: float) -> np.ndarray:
    """Return a Gaussian whose squares sum to 1: it keeps the variance of white noise."""
    sigma = 0.5 * correlation
    reach = int(np.ceil(KERNEL_REACH * sigma))
    kernel = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) / sigma))
    return kernel / np.linalg.norm(kernel)
