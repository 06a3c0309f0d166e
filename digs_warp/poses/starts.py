"""Motions between two frames to start from, tried coarsely: how a camera moves in a hand or on a head."""

import numpy as np

from digs_warp.geometry.rigid import matrix_from_rotation_vector, rigid
from digs_warp.poses.agreement import disagreements
from digs_warp.poses.views import Picture

# A hand that walks round something turns the camera about what it sees, by up to this [degree], about an axis
# that is upright: the camera looks down on it by one of these [degree].
TURNS = (-36.0, -30.0, -24.0, -18.0, -12.0, -6.0, 6.0, 12.0, 18.0, 24.0, 30.0, 36.0)
TILTS = (0.0, 30.0, 60.0)
# It looks from higher or lower by this [degree], and a head turns on the spot by these.
RISES = (-10.0, 10.0)
GLANCES = (-30.0, -20.0, -10.0, 10.0, 20.0, 30.0)
# Points of a frame that are looked up for each.
COARSE_SAMPLES = 250


def likely_starts(
    first: Picture, second: Picture, before: np.ndarray, most: int
) -> list[np.ndarray]:
    """Return the ``most`` motions ``second_from_first`` under which small pictures agree best, best first.

    Args:
        first: picture of about 80 columns.
        second: the same of the other frame.
        before: the motion between the frames before, (4, 4); one that goes on is likely.
        most: at least 1.
    """
    motions = [np.eye(4), before, *_usual_motions(first)]
    apart = disagreements(first, second, motions, COARSE_SAMPLES)
    return [motions[number] for number in np.argsort(apart, kind="stable")[:most]]


def _usual_motions(picture: Picture) -> list[np.ndarray]:
    pivot = np.array([0.0, 0.0, _middle_distance(picture)])
    tilts = np.radians(TILTS)
    upright = np.stack([np.zeros(len(TILTS)), np.cos(tilts), np.sin(tilts)], axis=1)
    across, down = np.eye(3)[:2]
    turns = [angle * axis for axis in upright for angle in np.radians(TURNS)]
    rises = [angle * across for angle in np.radians(RISES)]
    glances = [angle * axis for axis in (across, down) for angle in np.radians(GLANCES)]
    return [
        *(_turned(vector, pivot) for vector in (*turns, *rises)),
        *(_turned(vector, np.zeros(3)) for vector in glances),
    ]


def _turned(vector: np.ndarray, pivot: np.ndarray) -> np.ndarray:
    turn = matrix_from_rotation_vector(vector)
    return rigid(turn, pivot - turn @ pivot)


def _middle_distance(picture: Picture) -> float:
    """Return the usual distance [m] in the middle of the picture, or in all of it where that has no depth."""
    k = picture.intrinsics
    inner = picture.depth[k.height // 4 : -k.height // 4, k.width // 4 : -k.width // 4]
    known = inner if np.isfinite(inner).any() else picture.depth
    return float(1 / np.nanmean(1 / known))
