"""The motion of a hand that carries a camera: shake above half a hertz, and slow wander.

Its spectrum is that of a person who walked around a desk with a camera in the hand (TUM RGB-D, fr2/desk,
motion capture): position falls off as f^-4 and angle as f^-3 between 1 and 10 Hz, and physiological tremor
adds a low hump at 6 to 12 Hz. White noise per frame, the usual shortcut, would be far too strong at high
frequencies and far too weak at low ones.
"""

from collections.abc import Callable
from dataclasses import dataclass

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


BANDS_HZ = ((0.5, 1.0), (1.0, 3.5), (3.5, 7.0), (7.0, 12.5))

# Seconds left out at both ends of the periodic noise.
SHAKE_MARGIN = 4.0

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
    noise = colored_noise(count, spectrum.axis_density, SHAKE_MARGIN, rng)
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


# RMS over the distance: of the distance, and of the motion along the path and up and down.
DISTANCE_RMS, SIDEWAYS_RMS, HEIGHT_RMS = 0.066, 0.064, 0.064

# The logarithm of the distance stays between these.
NEAREST, FARTHEST = -0.06, 0.18

# Sideways and up and down: the largest share of the distance.
WIDEST = 0.15

# RMS of the aim [degree]: down and up, right and left, and roll.
AIM_RMS_DEG = (2.5, 2.8, 3.1)

# Largest drift of the aim, in RMS.
AIM_LIMIT = 2.0

# Below these [Hz] the spectrum is flat; above them it falls off like that of the shake.
POSITION_CORNER, POSITION_SLOPE = 0.065, 4.0
ANGLE_CORNER, ANGLE_SLOPE = 0.2, 3.2
FASTEST = 0.5  # [Hz]

# Seconds left out at both ends of the periodic noise: it is related to itself over half that time.
MARGIN = 30.0

# Identifies the wander in the seeds.
WANDER = 105


@dataclass(frozen=True, eq=False)
class Wander:
    """The wander over the samples of a walk.

    Attributes:
        nearness: natural logarithm of the distance over that of the path, shape (n,).
        sideways: turn about the vertical axis, counterclockwise from above [rad], shape (n,).
        upward: change of the elevation [rad], shape (n,).
        aim: drift of the direction without the limits of the frame, in RMS: about the camera's x axis, its y
            axis and its line of sight, within -AIM_LIMIT..AIM_LIMIT, shape (n, 3).
    """

    nearness: np.ndarray
    sideways: np.ndarray
    upward: np.ndarray
    aim: np.ndarray


def wander(count: int, seed: int, unsteadiness: float) -> Wander:
    """Return the wander of a hand over ``count`` samples at SAMPLE_RATE.

    Args:
        count: number of samples.
        seed: of the wander.
        unsteadiness: factor on the measured one; 0: none.
    """
    position_seed, angle_seed = np.random.SeedSequence([seed, WANDER]).spawn(2)
    position = _unit_noise(count, POSITION_CORNER, POSITION_SLOPE, position_seed)
    aim = _unit_noise(count, ANGLE_CORNER, ANGLE_SLOPE, angle_seed)
    straying = unsteadiness * position * (DISTANCE_RMS, SIDEWAYS_RMS, HEIGHT_RMS)
    nearest, farthest = distance_limits(unsteadiness)
    return Wander(
        nearness=np.where(
            straying[:, 0] < 0,
            bounded(straying[:, 0], -np.log(nearest)),
            bounded(straying[:, 0], np.log(farthest)),
        ),
        sideways=bounded(straying[:, 1], WIDEST * unsteadiness),
        upward=bounded(straying[:, 2], WIDEST * unsteadiness),
        aim=unsteadiness * bounded(aim, AIM_LIMIT),
    )


def distance_limits(unsteadiness: float) -> tuple[float, float]:
    """Return the smallest and the largest distance over that of the path."""
    return float(np.exp(NEAREST * unsteadiness)), float(np.exp(FARTHEST * unsteadiness))


def bounded(values: np.ndarray, limit: np.ndarray | float) -> np.ndarray:
    """Return the values, smoothly bent so that they stay within -limit..limit; small ones hardly change."""
    limit = np.maximum(limit, 1e-12)
    return limit * np.tanh(values / limit)


def _unit_noise(
    count: int, corner: float, slope: float, seed: np.random.SeedSequence
) -> np.ndarray:
    """Return noise of RMS 1 with a spectrum that is flat up to a corner and falls off as f^-slope."""

    def shape(frequencies: np.ndarray) -> np.ndarray:
        return 1.0 / (1.0 + (frequencies / corner) ** slope)

    def density(frequencies: np.ndarray) -> np.ndarray:
        grid = np.linspace(0.0, FASTEST, 20_001)
        total = float(np.trapezoid(shape(grid), grid))
        return np.where(frequencies <= FASTEST, shape(frequencies), 0.0) / total

    return colored_noise(count, density, MARGIN, np.random.default_rng(seed))
