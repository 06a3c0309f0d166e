"""The sum of octaves of smooth noise in float64, with SciPy's filters instead of OpenCV's."""

import numpy as np
from scipy.ndimage import convolve1d

from digs_warp.sim.sensor.noise_field import random_bytes

FINEST, PERSISTENCE = 1.5, 0.5


def octave_twin(rng: np.random.Generator, shape: tuple[int, int], correlation: float) -> np.ndarray:
    """Noise of variance 1; each octave has half the correlation and half the amplitude of the last."""
    count = 1
    while correlation / 2**count >= FINEST:
        count += 1
    finest = correlation / 2 ** (count - 1)
    field, variance = np.zeros(shape), 0.0
    for k in range(count):
        doublings = count - 1 - k
        size = tuple(-(-side // 2**doublings) for side in shape)
        octave = PERSISTENCE**k * _smooth(rng, size, finest)
        kept = 1.0
        if doublings:
            weights = np.eye(24)
            for _ in range(doublings):
                weights = _doubled(weights)
            weights = weights[len(weights) // 4 : -len(weights) // 4]
            places = np.arange(24.0)
            alike = np.exp(-(((places[:, None] - places) / finest) ** 2))
            kept = np.mean(np.sum((weights @ alike) * weights, axis=1)) ** 2
        variance += PERSISTENCE ** (2 * k) * kept
        field = octave if k == 0 else octave + _doubled(_doubled(field).T).T[: size[0], : size[1]]
    return field / np.sqrt(variance)


def _smooth(rng: np.random.Generator, shape: tuple[int, int], correlation: float) -> np.ndarray:
    sigma = correlation / 2
    reach = int(np.ceil(3 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    kernel /= np.sqrt(np.sum(kernel**2))
    size = (shape[0] + 2 * reach, shape[1] + 2 * reach)
    white = random_bytes(rng, size[0] * size[1]).reshape(size).astype(float)
    white = (white - 127.5) / np.sqrt((256**2 - 1) / 12)
    smooth = convolve1d(convolve1d(white, kernel, axis=0), kernel, axis=1)
    return smooth[reach : reach + shape[0], reach : reach + shape[1]]


def _doubled(values: np.ndarray) -> np.ndarray:
    """Twice as many rows, linear between those there are; the ends are repeated."""
    before = np.concatenate([values[:1], values[:-1]])
    after = np.concatenate([values[1:], values[-1:]])
    out = np.empty((2 * len(values), *values.shape[1:]))
    out[0::2] = 0.75 * values + 0.25 * before
    out[1::2] = 0.75 * values + 0.25 * after
    return out
