"""The shape that Gaussians have at the start: round, along the surface, or along the viewing ray."""

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera
from digs_warp.init.config import InitConfig
from digs_warp.init.normals import normals_from_depth
from digs_warp.init.uncertainty import depth_deviation, pixel_rays
from digs_warp.init.voxel import VoxelSums

# A flat Gaussian's standard deviation along the normal, as a share of the voxel size.
FLATNESS = 0.2


def shape_values(
    camera: Camera,
    depth: np.ndarray,
    keep: np.ndarray,
    config: InitConfig,
    baseline: float | None,
) -> np.ndarray | None:
    """Return the per-pixel values that the Gaussians' shape needs, shape (height, width, k), or None."""
    if config.shape == "flat":
        return normals_from_depth(camera, depth, keep)
    if config.shape == "ray":
        if baseline is None:
            raise DigsError(
                "initialization: shape 'ray' needs the baseline of the stereo camera, which the capture "
                "does not tell; add it to transforms.json (docs/capture-format.md) or choose 'round'"
            )
        rays = pixel_rays(camera)
        lengths = np.linalg.norm(rays, axis=-1, keepdims=True)
        focal_baseline = camera.intrinsics.fx * baseline
        deviation = depth_deviation(depth, config.disparity_noise, focal_baseline)
        along = np.nan_to_num(deviation)[..., None] * lengths
        return np.concatenate([rays / lengths, along**2], axis=-1)
    return None


def shaped_points(voxels: VoxelSums, config: InitConfig, voxel_size: float) -> PointCloud:
    """Return one point per voxel, with an axis unless the Gaussians are round."""
    if config.shape == "round":
        return PointCloud(voxels.points_world, voxels.colors)
    axes = voxels.extra[:, :3]
    lengths = np.linalg.norm(axes, axis=1)
    known = lengths > 1e-6
    units = np.where(known[:, None], axes / np.where(known, lengths, 1.0)[:, None], [0.0, 0.0, 1.0])
    if config.shape == "flat":
        # Where no pixel had a normal, the point stays as wide as its voxel in all directions.
        deviations = np.where(known, FLATNESS * voxel_size, voxel_size)
    else:
        # Views from all around bound the error from all sides: their rays cancel in the mean.
        along = voxels.extra[:, 3] * lengths**2
        deviations = np.sqrt(voxel_size**2 + along)
    return PointCloud(voxels.points_world, voxels.colors, units, deviations)
