"""The paths along which a camera is carried, without shake and wander: curves around the origin."""

from dataclasses import dataclass

import numpy as np

from digs_warp.sim.camera.walk.noise import SAMPLE_RATE
from digs_warp.sim.camera.walk.settings import PathName

# Share of a turn over which the camera climbs from one orbit to the next.
CLIMB_TURNS = 0.15

# Half the angle of an arc [rad].
HALF_ARC = np.pi / 3

# Where an approach begins, over the distance at which it ends.
APPROACH_FROM = 2.5

# Points of a turn, of an arc, or of an approach.
POINTS = 2000

# Time over which the camera turns back at the end of a path [s].
TURNING_BACK = 1.0


@dataclass(frozen=True, eq=False)
class Path:
    """A curve around the origin.

    Attributes:
        azimuth: counterclockwise from above, from the x axis [rad], shape (n,).
        elevation: above the horizon [rad], shape (n,).
        reach: distance from the origin, 1 where the camera is at its nearest, shape (n,).
    """

    azimuth: np.ndarray
    elevation: np.ndarray
    reach: np.ndarray

    @property
    def points(self) -> np.ndarray:
        """The points of the curve, shape (n, 3)."""
        return place(self.azimuth, self.elevation, self.reach)

    @property
    def lengths(self) -> np.ndarray:
        """The way from the start to each point, shape (n,)."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def lowest(self) -> float:
        """Height of the lowest point; a camera that starts farther away starts as high at least."""
        return float(self.points[:, 2].min())

    def walked(self, times: np.ndarray, speed: float) -> "Path":
        """Return the curve at times [s] from 0, evenly spaced at SAMPLE_RATE, at a constant speed [1/s].

        At its end the camera turns back.
        """
        lengths = self.lengths
        if lengths[-1] == 0.0:
            count = len(times)
            return Path(
                *(np.full(count, each[0]) for each in (self.azimuth, self.elevation, self.reach))
            )
        from scipy.interpolate import CubicSpline

        curve = CubicSpline(lengths, np.stack([self.azimuth, self.elevation, self.reach], axis=1))
        return Path(*curve(_to_and_fro(times, speed, float(lengths[-1]))).T)


def place(azimuth: np.ndarray, elevation: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return points by direction [rad] and distance from the origin, shape (n, 3)."""
    ring = np.cos(elevation)
    directions = np.stack(
        [ring * np.cos(azimuth), ring * np.sin(azimuth), np.sin(elevation)], axis=1
    )
    return np.asarray(reach)[:, None] * directions


def path_named(name: PathName, elevations: np.ndarray) -> Path:
    """Return a path.

    Args:
        name: which one.
        elevations: its heights above the horizon [rad], one or more; ``hover`` takes the first.
    """
    if name == "hover":
        return Path(np.zeros(1), elevations[:1], np.ones(1))
    if name == "approach":
        share = np.linspace(0.0, 1.0, POINTS)
        reach = APPROACH_FROM ** (1.0 - share)
        return Path(np.zeros(POINTS), _through(elevations, share), reach)
    legs = len(elevations)
    turns = np.linspace(0.0, legs, POINTS * legs + 1)
    elevation = np.full_like(turns, elevations[0])
    for leg in range(1, legs):
        climb = np.clip((turns - leg) / CLIMB_TURNS + 0.5, 0.0, 1.0)
        elevation += (elevations[leg] - elevations[leg - 1]) * _smooth_step(climb)
    azimuth = 2 * np.pi * turns if name == "orbits" else -HALF_ARC * np.cos(np.pi * turns)
    return Path(azimuth, elevation, np.ones_like(turns))


def _through(levels: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return a smooth course through evenly spaced levels at shares of 0 to 1."""
    if len(levels) == 1:
        return np.full_like(share, levels[0])
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(np.linspace(0.0, 1.0, len(levels)), levels)(share)


def _smooth_step(share: np.ndarray) -> np.ndarray:
    """Return 0 to 1 without a jump in speed or acceleration."""
    return share**3 * (10 - 15 * share + 6 * share**2)


def _to_and_fro(times: np.ndarray, speed: float, length: float) -> np.ndarray:
    """Return how far along a curve the camera is, 0 to ``length``, shape (n,)."""
    if speed * float(times[-1]) <= length:
        return speed * times
    window = np.hanning(int(TURNING_BACK * SAMPLE_RATE) | 1)
    reach = len(window) // 2
    around = (np.arange(len(times) + 2 * reach) - reach) / SAMPLE_RATE
    way = length - np.abs(np.mod(speed * around, 2 * length) - length)
    return np.convolve(way, window / window.sum(), mode="valid")
