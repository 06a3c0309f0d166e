"""Random points: the baseline that knows nothing about the surface (paper section 4.1).

The paper does not say where its random points lie. Here they fill the cube that the cameras look at: it is
centered at the point nearest to all optical axes, and as large as the narrower side of the image at that
distance. Their colors are random, too.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.viewpoints import looked_at
from digs_warp.geometry.camera import Camera

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
