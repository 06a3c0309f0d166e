"""Gaussians that start flat, along the surface normals of the depth maps: an extension of the paper."""

import numpy as np
import warp as wp

from digs_warp.data.point_cloud import PointCloud
from digs_warp.device.parallel import launch_here
from digs_warp.geometry.camera import Camera
from digs_warp.init.edges import on_device
from digs_warp.init.voxel import VoxelSums

wp.set_module_options({"enable_backward": False})

# The tangents reach this many pixels to either side; the farther they reach, the less noise tilts a normal.
REACH = 3

_REACH = wp.constant(REACH)

# A flat Gaussian's standard deviation along the normal, as a share of the voxel size.
FLATNESS = 0.2


@wp.func
def point_cam(column: int, row: int, depth: float, fx: float, fy: float, cx: float, cy: float):
    """Back-project a pixel into the camera's frame."""
    x = (float(column) + 0.5 - cx) / fx
    y = (float(row) + 0.5 - cy) / fy
    return wp.vec3(x * depth, y * depth, depth)


@wp.kernel
def normal_kernel(
    depth: wp.array2d[float],  # [height, width] NaN: unknown
    wanted: wp.array2d[wp.bool],  # [height, width]
    world_from_cam: wp.mat33,
    fx: float,
    fy: float,
    cx: float,
    cy: float,
    # outputs
    normals: wp.array3d[float],  # [height, width, 3] zero on entry
):
    """Write the unit normals of one row: of each wanted pixel whose four neighbors are known."""
    row = wp.tid()
    height = depth.shape[0]
    width = depth.shape[1]
    if row >= _REACH and row < height - _REACH:
        for column in range(_REACH, width - _REACH):
            if wanted[row, column]:
                left = depth[row, column - _REACH]
                right = depth[row, column + _REACH]
                upper = depth[row - _REACH, column]
                lower = depth[row + _REACH, column]
                rightwards = point_cam(column + _REACH, row, right, fx, fy, cx, cy)
                rightwards = rightwards - point_cam(column - _REACH, row, left, fx, fy, cx, cy)
                downwards = point_cam(column, row + _REACH, lower, fx, fy, cx, cy)
                downwards = downwards - point_cam(column, row - _REACH, upper, fx, fy, cx, cy)
                # x right, y down, z forward: down x right points back to the camera.
                normal_cam = wp.cross(downwards, rightwards)
                squared = wp.dot(normal_cam, normal_cam)
                if squared > 0.0:  # False for NaN
                    normal = world_from_cam * (normal_cam / wp.sqrt(squared))
                    normals[row, column, 0] = normal[0]
                    normals[row, column, 1] = normal[1]
                    normals[row, column, 2] = normal[2]


def normals_from_depth(camera: Camera, depth: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return unit normals in the world, toward the camera, shape (height, width, 3), float32.

    The normal is the cross product of the two central differences of the back-projected points, over a
    few pixels. It is zero where it is not wanted and where one of the four neighbors is unknown.

    Args:
        camera: of the view.
        depth: planar depth [m], shape (height, width), NaN where unknown.
        wanted: which pixels need a normal, shape (height, width), bool.
    """
    k = camera.intrinsics
    normals = np.zeros((*depth.shape, 3), dtype=np.float32)
    inputs = [
        on_device(np.ascontiguousarray(depth, dtype=np.float32)),
        on_device(np.ascontiguousarray(wanted)),
        wp.mat33(*camera.world_from_cam[:3, :3].ravel()),
        *(float(value) for value in (k.fx, k.fy, k.cx, k.cy)),
        on_device(normals),
    ]
    launch_here(normal_kernel, depth.shape[0], inputs)
    return normals


def flat_points(voxels: VoxelSums, voxel_size: float) -> PointCloud:
    """Return one point per voxel, with the mean of the normals in it as its axis.

    Where no pixel had a normal, the point stays as wide as its voxel in all directions.
    """
    axes = voxels.extra
    lengths = np.linalg.norm(axes, axis=1)
    known = lengths > 1e-6
    units = np.where(known[:, None], axes / np.where(known, lengths, 1.0)[:, None], [0.0, 0.0, 1.0])
    deviations = np.where(known, FLATNESS * voxel_size, voxel_size)
    return PointCloud(voxels.points_world, voxels.colors, units, deviations)
