"""The sparse points that came with a recording, such as those of a COLMAP model."""

import logging
from collections.abc import Sequence

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera

logger = logging.getLogger(__name__)

# With fewer, matching the images finds a better start.
FEWEST = 100


def recorded_points(capture: Capture, cameras: Sequence[Camera]) -> PointCloud | None:
    """Return the recording's points that a camera has in view; None: it has none, or hardly any.

    Args:
        capture: the recording; its points are in the world of its poses.
        cameras: of the training views.

    Raises:
        DigsError: the file of the points cannot be read.
    """
    points = capture.load_points()
    if points is None:
        return None
    shown = in_view(points.points_world, cameras)
    count = int(shown.sum())
    if count < len(points):
        unseen = len(points) - count
        logger.info("%d of %d sparse points are in no image, and are left out", unseen, len(points))
    if count < FEWEST:
        logger.warning(
            "%s: %d of its %d sparse points are in view, which is too few to start from; matching the images",
            *(capture, count, len(points)),
        )
        return None
    return points.select(shown)


def in_view(points_world: np.ndarray, cameras: Sequence[Camera]) -> np.ndarray:
    """Return which points lie in front of a camera and inside its image, shape (n,), bool."""
    shown = np.zeros(len(points_world), dtype=bool)
    for camera in cameras:
        shown |= camera.shows(*camera.project(points_world))
    return shown
