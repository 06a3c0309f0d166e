"""The result of structure from motion: posed cameras, sparse points, and observations."""

from dataclasses import dataclass, replace

import numpy as np

from digs_warp.checks import check_positive
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import transform_points


@dataclass(frozen=True, eq=False)
class Observations:
    """Which camera saw which point, and where; one entry per measurement.

    Attributes:
        cameras: index into `SfmModel.names`, shape (m,), int32.
        points: index into `SfmModel.points`, shape (m,), int32.
        px: pixel (u, v) of the measured feature, shape (m, 2), float32.
    """

    cameras: np.ndarray
    points: np.ndarray
    px: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "cameras", np.asarray(self.cameras, dtype=np.int32))
        object.__setattr__(self, "points", np.asarray(self.points, dtype=np.int32))
        object.__setattr__(self, "px", np.asarray(self.px, dtype=np.float32))

    def __len__(self) -> int:
        return len(self.cameras)


@dataclass(frozen=True, eq=False)
class SfmModel:
    """Cameras and sparse points in one frame, whose unit is [sfm] until `in_metres`.

    Attributes:
        names: names of the registered frames, in the order of the recording.
        cameras: their cameras, one per name; ``world_from_cam`` translates in [sfm].
        points: sparse points [sfm] with colors.
        observations: which camera saw which point.
        reprojection_errors: mean error of each point [px], shape (n,), float32.
    """

    names: tuple[str, ...]
    cameras: tuple[Camera, ...]
    points: PointCloud
    observations: Observations
    reprojection_errors: np.ndarray

    def in_metres(self, sfm_per_metre: float) -> "SfmModel":
        """Return the model in metres, given the scale found from the depth maps (paper eq. 6, 7).

        Raises:
            DigsError: the scale is not a finite number above 0.
        """
        scale = check_positive("sfm_per_metre", sfm_per_metre)
        poses = np.stack([camera.world_from_cam for camera in self.cameras])
        poses[:, :3, 3] /= scale
        pairs = zip(self.cameras, poses, strict=True)
        cameras = tuple(replace(camera, world_from_cam=pose) for camera, pose in pairs)
        points = PointCloud(self.points.points_world / np.float32(scale), self.points.colors)
        return replace(self, cameras=cameras, points=points)

    def moved(self, new_from_old: np.ndarray) -> "SfmModel":
        """Return the model after a rigid motion of the world, (4, 4)."""
        cameras = tuple(
            replace(c, world_from_cam=new_from_old @ c.world_from_cam) for c in self.cameras
        )
        points = transform_points(new_from_old, self.points.points_world.astype(np.float64))
        return replace(self, cameras=cameras, points=PointCloud(points, self.points.colors))
