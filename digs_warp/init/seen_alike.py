"""At which of several depths other photographs show a pixel in its own color."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.geometry.camera import Camera

# Photographs are compared at this width [px] or less, blurred by this standard deviation [px]: the depths
# that are tried lie far apart.
WIDTH, BLUR = 320, 1.0
# A pixel is compared with this many photographs, those from the nearest places.
OTHERS = 6
# Differences of color [of 255] count up to this: beyond, another thing is seen, for something may hide the
# place.
UNLIKE = 40.0


@dataclass(frozen=True, eq=False)
class Look:
    """A photograph, reduced.

    Attributes:
        camera: of the reduced photograph.
        colors: sRGB in 0..255, (height, width, 3), float32.
    """

    camera: Camera
    colors: np.ndarray

    def at(self, points_world: np.ndarray) -> np.ndarray:
        """Return the colors of points (n, 3), NaN outside of the image."""
        px, depth = self.camera.project(points_world)
        inside = self.camera.shows(px, depth)
        found = np.full((len(px), 3), np.nan, np.float32)
        columns, rows = px[inside].astype(np.intp).T
        found[inside] = self.colors[rows, columns]
        return found


def look(frame: Frame) -> Look:
    """Return a frame's photograph, reduced."""
    import cv2

    image = frame.load_image()
    height, width = image.shape[:2]
    size = (min(width, WIDTH), max(1, round(height * min(1.0, WIDTH / width))))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    return Look(frame.camera.resized(*size), cv2.GaussianBlur(small, (0, 0), BLUR))


def nearest_looks(mine: Look, looks: Sequence[Look]) -> list[Look]:
    """Return those of the other photographs that were taken from the nearest places."""
    others = [each for each in looks if each is not mine]
    apart = [np.linalg.norm(each.camera.center_world - mine.camera.center_world) for each in others]
    return [others[i] for i in np.argsort(apart, kind="stable")[:OTHERS]]


def most_alike(mine: Look, others: Sequence[Look], tried_world: np.ndarray) -> np.ndarray:
    """Return at which of k places on its ray each of n pixels has most nearly its color in others, (n,).

    Args:
        mine: the pixels' photograph.
        others: at least one.
        tried_world: shape (k, n, 3).
    """
    tries, count = tried_world.shape[:2]
    points = tried_world.reshape(-1, 3)
    own = mine.at(points)
    total, seen = np.zeros((2, tries * count))
    for other in others:
        miss = np.minimum(np.abs(other.at(points) - own).mean(axis=1), UNLIKE)
        shown = np.isfinite(miss)
        total[shown] += miss[shown]
        seen += shown
    misses = np.where(seen > 0, total / np.maximum(seen, 1), UNLIKE)
    return misses.reshape(tries, count).argmin(axis=0)
