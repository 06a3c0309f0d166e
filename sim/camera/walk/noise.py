"""Gaussian noise with a given spectrum, sampled at SAMPLE_RATE."""

from collections.abc import Callable

import numpy as np

SAMPLE_RATE = 60.0  # [Hz]; the measured shake ends at 12.5 Hz

# Frequencies [Hz], shape (n,) -> one-sided power spectral density [unit^2/Hz], shape (n,).
Density = Callable[[np.ndarray], np.ndarray]


def colored_noise(
    count: int, density: Density, margin: float, rng: np.random.Generator, tracks: int = 3
) -> np.ndarray:
    """Return independent tracks, shape (count, tracks), whose mean squares are the integral of the density.

    Args:
        count: number of samples.
        density: of each track.
        margin: seconds that are left out at both ends, because the noise is periodic by construction.
        rng: source of the noise.
        tracks: how many.
    """
    total = count + 2 * int(margin * SAMPLE_RATE)
    frequencies = np.fft.rfftfreq(total, 1.0 / SAMPLE_RATE)
    # Expected |coefficient|^2 of a real track whose mean square is the integral of the density.
    power = density(frequencies) * total * SAMPLE_RATE / 2.0
    normal = rng.standard_normal((tracks, 2, len(frequencies)))
    coefficients = np.sqrt(power / 2.0) * (normal[:, 0] + 1j * normal[:, 1])
    coefficients[:, 0] = 0.0
    found = np.fft.irfft(coefficients, total, axis=1)
    start = (total - count) // 2
    return found[:, start : start + count].T
