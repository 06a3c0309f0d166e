"""Points without a surface: those that came with a recording, and random ones (paper section 4.1).

The paper does not say where its random points lie. Here they fill the cube that the cameras look at: it is
centered at the point nearest to all optical axes, and as large as the narrower side of the image at that
distance. Their colors are random, too.
"""

import logging
from collections.abc import Sequence

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.viewpoints import looked_at
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
    shown = np.zeros(len(points), dtype=bool)
    for camera in cameras:
        shown |= camera.shows(*camera.project(points.points_world))
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


SEED = 0


def random_points(cameras: Sequence[Camera], count: int) -> PointCloud:
    """Return ``count`` points, uniform in the cube that the cameras look at; always the same ones.

    Raises:
        DigsError: all cameras look in the same direction, so their axes have no nearest point.
    """
    center, half = cube_looked_at(cameras)
    rng = np.random.default_rng(SEED)
    offsets = rng.uniform(-1.0, 1.0, (count, 3)) * half
    return PointCloud(center + offsets, rng.uniform(0.0, 1.0, (count, 3)))


def cube_looked_at(cameras: Sequence[Camera]) -> tuple[np.ndarray, float]:
    """Return center and half the side [m] of the cube at which the cameras look, as large as they show there.

    Raises:
        DigsError: as of `looked_at`.
    """
    try:
        center = looked_at(cameras)
    except DigsError as error:
        raise DigsError(f"initialization: {error}; choose another strategy") from error
    half_sides = [
        np.linalg.norm(camera.center_world - center)
        * min(k.width / (2 * k.fx), k.height / (2 * k.fy))
        for camera in cameras
        for k in [camera.intrinsics]
    ]
    return center, float(np.median(half_sides))
