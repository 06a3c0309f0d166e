"""The pinhole camera of the whole project.

Axes are OpenCV's: x right, y down, z forward. The center of the first pixel is (0.5, 0.5), so
``u = fx * x / z + cx`` puts a point on the optical axis of a centered camera at ``u = width / 2``.
"""

from dataclasses import dataclass, replace

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.geometry.reproject import is_inside, project, unproject
from digs_warp.geometry.rigid import invert_rigid, is_rigid, transform_points

# Of the focal length: the lines of more would be off by a pixel.
MOST_SKEW = 1e-3


@dataclass(frozen=True)
class Intrinsics:
    """Image size [px] and pinhole parameters [px]; the principal point may lie anywhere."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise DigsError(f"camera: image size {self.width}x{self.height}, expected at least 1x1")
        if not (np.isfinite([self.fx, self.fy, self.cx, self.cy]).all() and self.fx > 0 < self.fy):
            raise DigsError(
                f"camera: fx={self.fx}, fy={self.fy}, cx={self.cx}, cy={self.cy}; "
                "expected finite values and focal lengths above 0"
            )

    @staticmethod
    def from_fov(width: int, height: int, horizontal_fov_deg: float) -> "Intrinsics":
        """Return a centered camera with square pixels and the given horizontal field of view."""
        focal = 0.5 * width / np.tan(0.5 * np.deg2rad(horizontal_fov_deg))
        return Intrinsics(width, height, float(focal), float(focal), width / 2, height / 2)

    @staticmethod
    def from_matrix(
        matrix: np.ndarray, width: int, height: int, first_center: float = 0.5
    ) -> "Intrinsics":
        """Return the camera of a matrix K, [[fx, 0, cx], [0, fy, cy], ...], shape (3, 3) or larger.

        Args:
            matrix: K.
            width: of the image [px].
            height: of the image [px].
            first_center: where K has the center of the first pixel: at 0.5, as here, or at 0, as calibrations
                with OpenCV, ROS and Open3D have it.

        Raises:
            DigsError: not finite, no focal length, a skew, or rows that are columns.
        """
        k = np.asarray(matrix, dtype=np.float64)
        zeros = (k[0, 1], *k[1:3, 0], k[2, 1]) if k.ndim == 2 and min(k.shape) > 2 else [np.inf]
        if max(map(abs, zeros)) > MOST_SKEW * np.abs(k).max(initial=0.0):
            raise DigsError(
                f"camera: expected a matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], found\n{matrix}"
            )
        center = k[:2, 2] + (0.5 - first_center)
        return Intrinsics(width, height, *map(float, (k[0, 0], k[1, 1], *center)))

    @property
    def matrix(self) -> np.ndarray:
        """The (3, 3) matrix K: ``px ~ K @ point_cam``."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]])

    def resized(self, width: int, height: int) -> "Intrinsics":
        """Return the camera of the same view at another image size."""
        sx, sy = width / self.width, height / self.height
        return Intrinsics(width, height, self.fx * sx, self.fy * sy, self.cx * sx, self.cy * sy)


@dataclass(frozen=True, eq=False)
class Camera:
    """Intrinsics and the rigid transform ``world_from_cam``, shape (4, 4), float64, metres."""

    intrinsics: Intrinsics
    world_from_cam: np.ndarray

    def __post_init__(self) -> None:
        matrix = np.asarray(self.world_from_cam, dtype=np.float64)
        if not is_rigid(matrix):
            raise DigsError(
                "camera: world_from_cam is not a rigid transform (finite, orthonormal, right-handed, "
                f"last row 0 0 0 1); found\n{matrix}"
            )
        object.__setattr__(self, "world_from_cam", matrix)

    @property
    def cam_from_world(self) -> np.ndarray:
        """The inverse of ``world_from_cam``."""
        return invert_rigid(self.world_from_cam)

    @property
    def center_world(self) -> np.ndarray:
        """The optical center in the world [m], shape (3,)."""
        return self.world_from_cam[:3, 3]

    def project(self, points_world: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pixels (u, v), shape (..., 2), and planar depths [m], shape (...).

        Points with depth <= 0 lie behind the camera: their pixels mean nothing.
        """
        points_cam = transform_points(self.cam_from_world, np.asarray(points_world, np.float64))
        u, v, depth = project(points_cam, self.intrinsics)
        return np.stack([u, v], axis=-1), depth

    def shows(self, px: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Return which of the projected points lie in front of the camera and inside its image, (...), bool.

        Args:
            px: pixels (u, v) of `project`, shape (..., 2); NaN is outside.
            depth: planar depths of `project`, shape (...).
        """
        return is_inside(px[..., 0], px[..., 1], depth, self.intrinsics)

    def unproject(self, px: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Return world points, shape (..., 3), of pixels (u, v) with planar depth [m] (eq. 8)."""
        points_cam = unproject(px[..., 0], px[..., 1], depth, self.intrinsics)
        return transform_points(self.world_from_cam, points_cam)

    def resized(self, width: int, height: int) -> "Camera":
        """Return the same view at another image size."""
        return replace(self, intrinsics=self.intrinsics.resized(width, height))

    def every(self, stride: int) -> "Camera":
        """Return the view of every n-th row and column of the image, beginning with the first ones."""
        k = self.intrinsics
        width, height = (-(-side // stride) for side in (k.width, k.height))
        center = ((c - 0.5) / stride + 0.5 for c in (k.cx, k.cy))
        return replace(
            self, intrinsics=Intrinsics(width, height, k.fx / stride, k.fy / stride, *center)
        )

    def cropped(self, rows: slice, columns: slice) -> "Camera":
        """Return the view of a part of the image; starts and stops are given, and it is not empty."""
        k = self.intrinsics
        part = Intrinsics(
            columns.stop - columns.start,
            rows.stop - rows.start,
            *(k.fx, k.fy, k.cx - columns.start, k.cy - rows.start),
        )
        return replace(self, intrinsics=part)

    def shifted_right(self, baseline: float) -> "Camera":
        """Return the camera ``baseline`` metres along this one's x axis: the right eye of a rig."""
        matrix = self.world_from_cam.copy()
        matrix[:3, 3] += baseline * matrix[:3, 0]
        return replace(self, world_from_cam=matrix)


def pixel_centers(width: int, height: int) -> np.ndarray:
    """Return (u, v) of all pixel centers, shape (height, width, 2); the first is (0.5, 0.5)."""
    u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([u, v], axis=-1)
