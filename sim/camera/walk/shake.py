"""The shake of a hand, above half a hertz.

Its spectrum is that of a person who walked around a desk with a camera in the hand (TUM RGB-D, fr2/desk,
motion capture): position falls off as f^-4 and angle as f^-3 between 1 and 10 Hz, and physiological tremor
adds a low hump at 6 to 12 Hz. White noise per frame, the usual shortcut, would be far too strong at high
frequencies and far too weak at low ones.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.sim.camera.walk.noise import colored_noise

BANDS_HZ = ((0.5, 1.0), (1.0, 3.5), (3.5, 7.0), (7.0, 12.5))

# Seconds left out at both ends of the periodic noise.
MARGIN = 4.0

# The shake reaches this many times its RMS along an axis: a hand that films an object has no rarer peaks.
PEAK = 3.0

TREMOR_PEAK_HZ = 8.5
TREMOR_WIDTH_HZ = 1.5


@dataclass(frozen=True)
class ShakeSpectrum:
    """Power spectrum of one kind of shake, summed over its three axes.

    Attributes:
        band_rms: RMS in each of BANDS_HZ, of the length of the 3-vector.
        slope: the density falls off as f^-slope.
        tremor: height of the tremor hump over the slope at its peak, relative.
    """

    band_rms: tuple[float, float, float, float]
    slope: float
    tremor: float

    @property
    def axis_rms(self) -> float:
        """RMS along one axis over all bands."""
        return float(np.sqrt(np.sum(np.square(self.band_rms)) / 3.0))

    def axis_density(self, frequencies: np.ndarray) -> np.ndarray:
        """Return the power spectral density of one axis."""
        return _density(frequencies, self) / 3.0


POSITION_SHAKE = ShakeSpectrum((8.3e-3, 2.0e-3, 0.19e-3, 0.12e-3), slope=4.0, tremor=2.0)  # [m]
ANGLE_SHAKE = ShakeSpectrum((0.91, 0.56, 0.15, 0.068), slope=3.2, tremor=0.5)  # [degree]


def shake_tracks(count: int, seed: np.random.SeedSequence) -> tuple[np.ndarray, np.ndarray]:
    """Return shake over ``count`` samples at SAMPLE_RATE: position [m] and angle [degree], (count, 3)."""
    position_seed, angle_seed = seed.spawn(2)
    return (
        _track(count, POSITION_SHAKE, position_seed),
        _track(count, ANGLE_SHAKE, angle_seed),
    )


def _track(count: int, spectrum: ShakeSpectrum, seed: np.random.SeedSequence) -> np.ndarray:
    rng = np.random.default_rng(seed)
    noise = colored_noise(count, spectrum.axis_density, MARGIN, rng)
    # A knee so sharp that it leaves the rest as it is.
    return noise / (1.0 + (noise / (PEAK * spectrum.axis_rms)) ** 8) ** (1 / 8)


def _density(frequencies: np.ndarray, spectrum: ShakeSpectrum) -> np.ndarray:
    """Return the one-sided power spectral density, scaled so that each band has its measured RMS."""

    def shape(f: np.ndarray) -> np.ndarray:
        hump = np.exp(-0.5 * ((f - TREMOR_PEAK_HZ) / TREMOR_WIDTH_HZ) ** 2)
        return f**-spectrum.slope * (1.0 + spectrum.tremor * hump)

    density = np.zeros_like(frequencies)
    low_edge, high_edge = BANDS_HZ[0][0], BANDS_HZ[-1][1]
    for (low, high), rms in zip(BANDS_HZ, spectrum.band_rms, strict=True):
        grid = np.linspace(low, high, 4001)
        gain = rms**2 / np.trapezoid(shape(grid), grid)
        # The last band continues to the end of the spectrum, where nothing was measured and little is left.
        inside = (frequencies >= low) & ((frequencies < high) | (high == high_edge))
        density[inside] = gain * shape(frequencies[inside])
        if low == low_edge:
            # What is slower is the wander of the walk.
            slow = frequencies < low
            edge = gain * float(shape(np.array([low]))[0])
            density[slow] = edge * (frequencies[slow] / low) ** 2
    return density
