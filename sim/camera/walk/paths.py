"""The paths along which a camera is carried, and how the images are framed on the way."""

from dataclasses import dataclass

import numpy as np

from digs_warp.checks import check_positive
from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.camera.walk.hand_motion import (
    ANGLE_SHAKE,
    PEAK,
    POSITION_SHAKE,
    SAMPLE_RATE,
    distance_limits,
)
from digs_warp.sim.camera.walk.settings import PathName

# The bounding sphere and the shake together fill this share of the image.
FILLED = 0.97

# Turns and offsets rarely peak together: this much more than their peaks as independent errors add.
TOGETHER = 1.1

# Shake takes at most this share of half the field of view.
MOST_SHAKE = 1.0 / 3.0

# The room for the aim never closes fully [rad], so that it changes smoothly.
LEAST_ROOM = np.deg2rad(0.1)


def half_angles(intrinsics: Intrinsics) -> np.ndarray:
    """Return the angles [rad] from the principal axis to the nearer edges, across and up: shape (2,)."""
    k = intrinsics
    across, up = min(k.cx, k.width - k.cx), min(k.cy, k.height - k.cy)
    return np.arctan([max(across, 0.5) / k.fx, max(up, 0.5) / k.fy])


def fitting_distance(
    radius: float,
    intrinsics: Intrinsics,
    shake: float = 1.0,
    unsteadiness: float = 1.0,
    baseline: float = 0.0,
) -> float:
    """Return the distance [m] of a path on which a sphere of ``radius`` [m] stays in the images.

    The margin grows with the shake, with the wander of the distance, and with the distance [m] of an eye to
    the right, ``baseline``; the aim drifts only within what the frame leaves free.
    """
    check_positive("object radius", radius)
    half = FILLED * half_angles(intrinsics)

    def fits(distance: float) -> bool:
        needed = _needed(radius, distance, float(half.min()), shake)
        return bool((needed + _aside(distance, baseline) <= half).all())

    # As far as the sphere alone asks for, and as far as twice that: the need falls with the distance.
    low = radius / np.sin(float(half.min()))
    high = 2.0 * low
    while not fits(high):
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fits(middle) else (middle, high)
    nearest, _ = distance_limits(unsteadiness)
    return float(high / nearest)


def room(
    radius: float,
    distances: np.ndarray,
    intrinsics: Intrinsics,
    shake: float,
    baseline: float = 0.0,
) -> np.ndarray:
    """Return by how much [rad] the aim may drift across and up before the sphere leaves an image, (n, 2).

    Where the object is larger than the image, it is how far the camera may turn before the object no longer
    fills it. ``baseline``: how far to the right of the aimed eye another one takes images [m].
    """
    half = half_angles(intrinsics)
    needed = _needed(radius, distances, FILLED * float(half.min()), shake)
    free = np.abs(FILLED * half - np.asarray(needed)[:, None])
    return np.hypot(np.maximum(free - _aside(distances, baseline), 0.0), LEAST_ROOM)


def _aside(distance: np.ndarray | float, baseline: float) -> np.ndarray:
    """Return how far [rad] across and up the right eye sees what the left one has in its middle, (..., 2)."""
    across = np.arctan(baseline / np.asarray(distance))
    return np.stack([across, np.zeros_like(across)], axis=-1)


def _needed(radius: float, distance: np.ndarray | float, half_angle: float, shake: float):
    """Return the angle [rad] from the middle of the image that the sphere and the shake take up."""
    sphere = np.arcsin(np.minimum(radius / np.asarray(distance), 1.0))
    turns = TOGETHER * PEAK * shake * np.deg2rad(ANGLE_SHAKE.axis_rms)
    offsets = TOGETHER * PEAK * shake * POSITION_SHAKE.axis_rms / np.asarray(distance)
    return sphere + np.minimum(np.hypot(turns, offsets), MOST_SHAKE * half_angle)


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
        elevations: its heights above the horizon [rad], one or more; ``hover`` and ``turntable`` take
            the first.
    """
    if name in ("hover", "turntable"):
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
