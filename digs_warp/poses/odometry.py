"""Open3D's odometry: with little texture it finds motions from farther off than `align` does."""

import numpy as np

from digs_warp.device.libraries import import_open3d
from digs_warp.geometry.reproject import SAME_SURFACE
from digs_warp.poses.information import FARTHEST, usual_distance
from digs_warp.poses.views import Picture

# Steps at each size, from the smallest image.
STEPS = (20, 15, 10)
# Open3D's threads add up in another order each time, which changes the last of 16 digits; this many are kept.
DIGITS = 9


def odometry(first: Picture, second: Picture, start: np.ndarray) -> np.ndarray:
    """Return ``second_from_first`` by color and depth together, (4, 4); the start where that fails.

    Park et al., "Colored point cloud registration revisited", ICCV 2017.
    """
    open3d = import_open3d()
    pipeline = open3d.pipelines.odometry
    near, k = usual_distance(first), first.intrinsics
    option = pipeline.OdometryOption(
        iteration_number_per_pyramid_level=open3d.utility.IntVector(STEPS),
        depth_diff_max=SAME_SURFACE.relative * near,
        depth_min=0.0,
        depth_max=FARTHEST * near,
    )
    # Open3D puts integers at the centers of pixels.
    camera = open3d.camera.PinholeCameraIntrinsic(
        k.width, k.height, k.fx, k.fy, k.cx - 0.5, k.cy - 0.5
    )
    good, motion, _ = pipeline.compute_rgbd_odometry(
        _rgbd_image(first),
        _rgbd_image(second),
        camera,
        start,
        pipeline.RGBDOdometryJacobianFromHybridTerm(),
        option,
    )
    return np.round(motion, DIGITS) if good else start


def _rgbd_image(picture: Picture):
    geometry = import_open3d().geometry
    image = geometry.RGBDImage()
    image.color = geometry.Image(np.ascontiguousarray(picture.brightness, np.float32))
    depth = np.nan_to_num(picture.depth, nan=0.0).astype(np.float32)
    image.depth = geometry.Image(np.ascontiguousarray(depth))
    return image
