"""Motions between frames from matched features whose depth is measured: metric, from any start."""

from dataclasses import dataclass

import numpy as np

from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.reproject import project, unproject
from digs_warp.geometry.rigid import rigid, transform_points
from digs_warp.measure.sift import match_descriptors, sift
from digs_warp.poses import thresholds
from digs_warp.poses.views import Picture

# Features of a frame, the strongest first; OpenCV's threshold of contrast, a tenth of what is usual, and of
# edges, over twice: in a white room, weak features are all that there is.
FEATURES, CONTRAST, EDGE = 1500, 0.004, 25.0
# Draws of RANSAC.
DRAWS = 400


@dataclass(frozen=True, eq=False)
class Features:
    """Of a frame.

    Attributes:
        px: places, pixel centers at +0.5, (n, 2), float64.
        points: in the axes of the camera [m], (n, 3); NaN without depth.
        descriptors: (n, 128), float32.
    """

    px: np.ndarray
    points: np.ndarray
    descriptors: np.ndarray


@dataclass(frozen=True, eq=False)
class Matches:
    """Features of two frames that look alike; some of the pairs are wrong.

    Attributes:
        points: in the axes of the source [m], (n, 3).
        px: where the target has them, (n, 2).
        camera: of the target.
    """

    points: np.ndarray
    px: np.ndarray
    camera: Intrinsics

    def agreeing(self, target_from_source: np.ndarray) -> int:
        """Return how many matches agree with a motion."""
        u, v, depth = project(transform_points(target_from_source, self.points), self.camera)
        near = np.hypot(u - self.px[:, 0], v - self.px[:, 1]) < thresholds.MAX_REPROJECTION_ERROR
        return int(np.count_nonzero(near & (depth > 0)))

    def motion(self) -> np.ndarray | None:
        """Return the motion that most agree on, (4, 4), by RANSAC over three; None if they are few."""
        import cv2

        if len(self.px) < thresholds.MIN_INLIERS:
            return None
        good, turn, shift, inside = cv2.solvePnPRansac(
            *(self.points, self.px, self.camera.matrix, None),
            iterationsCount=DRAWS,
            reprojectionError=thresholds.MAX_REPROJECTION_ERROR,
            confidence=0.9999,
            flags=cv2.SOLVEPNP_AP3P,
        )
        if not good or inside is None or len(inside) < thresholds.MIN_INLIERS:
            return None
        kept = np.asarray(inside, dtype=np.intp)[:, 0]
        turn, shift = cv2.solvePnPRefineLM(
            self.points[kept], self.px[kept], self.camera.matrix, None, turn, shift
        )
        return rigid(cv2.Rodrigues(turn)[0], shift[:, 0])


def features_of(picture: Picture) -> Features:
    """Return the SIFT features of a picture."""
    gray = (255 * picture.brightness).clip(0, 255).astype(np.uint8)
    px, descriptors = sift(gray, FEATURES, contrastThreshold=CONTRAST, edgeThreshold=EDGE)
    k = picture.intrinsics
    column, row = np.minimum(px, [k.width - 1, k.height - 1]).astype(np.intp).T
    z = picture.depth[row, column].astype(np.float64)
    points = unproject(px[:, 0], px[:, 1], z, k)
    return Features(px, points, descriptors)


def matched(first: Features, second: Features, target: Intrinsics) -> Matches:
    """Return the matches of two frames: of the second, with intrinsics ``target``, only the pixels count."""
    deep = np.flatnonzero(np.isfinite(first.points[:, 2]))
    if len(deep) < thresholds.MIN_INLIERS or len(second.px) < thresholds.MIN_INLIERS:
        return Matches(np.zeros((0, 3)), np.zeros((0, 2)), target)
    ratio = thresholds.MAX_DESCRIPTOR_RATIO
    here, there = match_descriptors(first.descriptors[deep], second.descriptors, ratio)
    return Matches(first.points[deep[here]], second.px[there], target)
