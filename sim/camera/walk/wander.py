"""The slow wander of a hand, below half a hertz: distance, height and pace vary, and the aim drifts.

Its size and its pace were measured on a person who carried a camera once around a cabinet, 1.7 m away (TUM
RGB-D, fr3/cabinet, motion capture, a pose every 1.34 s). Position is relative to the
distance: from nearby, a hand that fills the image with an object strays less.

People correct before the object leaves the image. So the wander is bounded: it never comes nearer than the
framing allows for (`digs_warp.sim.camera.walk.framing`), and the aim drifts as far as the frame has room.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.sim.camera.walk.noise import colored_noise

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


@dataclass(frozen=True)
class WanderSpectrum:
    """A spectrum of RMS 1 that is flat up to a corner, falls off as f^-slope, and ends at FASTEST."""

    corner: float
    slope: float

    def density(self, frequencies: np.ndarray) -> np.ndarray:
        """Return the one-sided power spectral density."""
        grid = np.linspace(0.0, FASTEST, 20_001)
        total = float(np.trapezoid(self._shape(grid), grid))
        return np.where(frequencies <= FASTEST, self._shape(frequencies), 0.0) / total

    def _shape(self, frequencies: np.ndarray) -> np.ndarray:
        return 1.0 / (1.0 + (frequencies / self.corner) ** self.slope)


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
    position = _unit_noise(count, WanderSpectrum(POSITION_CORNER, POSITION_SLOPE), position_seed)
    aim = _unit_noise(count, WanderSpectrum(ANGLE_CORNER, ANGLE_SLOPE), angle_seed)
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


def _unit_noise(count: int, spectrum: WanderSpectrum, seed: np.random.SeedSequence) -> np.ndarray:
    return colored_noise(count, spectrum.density, MARGIN, np.random.default_rng(seed))
