"""From how far away an object stays in the images of a hand-held camera, and what room the aim has."""

import numpy as np

from digs_warp.checks import check_positive
from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.camera.walk.shake import ANGLE_SHAKE, PEAK, POSITION_SHAKE
from digs_warp.sim.camera.walk.wander import distance_limits

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
