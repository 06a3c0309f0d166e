"""The only place that projects a point, unprojects a pixel, and decides whether two frames agree in depth.

Axes are OpenCV's, the center of the first pixel is (0.5, 0.5), depth is planar z; `reproject_kernel` is the
twin for Warp kernels. A point of one frame is compared with the depth that another frame measured where it
sees the point:

    p_other = other_from_cam p        u = fx x / z + cx,  v = fy y / z + cy        measured = depth[v, u]

    |measured - z| < limit            the frames agree: they see the same surface
    measured <= z - limit             the point is occluded: the other frame sees something before it
    measured >= z + limit             the other frame sees through the point: the frames contradict each other
    measured is NaN                   nothing is known
"""

from typing import TYPE_CHECKING, NamedTuple, TypeAlias, Union

import numpy as np

if TYPE_CHECKING:
    from digs_warp.geometry.camera import Intrinsics


class Pinholes(NamedTuple):
    """The intrinsics of several images, as arrays that broadcast over their points."""

    width: np.ndarray
    height: np.ndarray
    fx: np.ndarray
    fy: np.ndarray
    cx: np.ndarray
    cy: np.ndarray


Pinhole: TypeAlias = Union["Intrinsics", Pinholes]


def unproject(u: np.ndarray, v: np.ndarray, depth: np.ndarray, k: Pinhole) -> np.ndarray:
    """Return the points, in the axes of the camera, of pixels with planar depth [m], shape (..., 3)."""
    return np.stack([(u - k.cx) / k.fx * depth, (v - k.cy) / k.fy * depth, depth], axis=-1)


def unproject_pixels(
    rows: np.ndarray, columns: np.ndarray, depth: np.ndarray, k: Pinhole
) -> np.ndarray:
    """Return the points in the middle of whole pixels, (n, 3); ``depth``: of those pixels [m], (n,)."""
    return unproject(columns + 0.5, rows + 0.5, depth, k)


def project(points_cam: np.ndarray, k: Pinhole) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return u, v [px] and planar depth [m] of points (..., 3) in the axes of the camera.

    Points with depth <= 0 lie behind the camera: their pixels mean nothing.
    """
    x, y, depth = np.moveaxis(points_cam, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return k.fx * x / depth + k.cx, k.fy * y / depth + k.cy, depth


def is_inside(u: np.ndarray, v: np.ndarray, depth: np.ndarray, k: Pinhole) -> np.ndarray:
    """Return which projected points lie before the camera and inside its image, bool; NaN is outside."""
    with np.errstate(invalid="ignore"):
        return (depth > 0) & (u >= 0) & (u < k.width) & (v >= 0) & (v < k.height)


class Reprojection(NamedTuple):
    """Where a frame sees points.

    Attributes:
        points: in the axes of its camera [m], (..., 3).
        inside: whether they lie before the camera and inside its image, (...), bool.
        rows: of the pixels they fall into, (...); 0 where outside.
        columns: the same; 0 where outside.
    """

    points: np.ndarray
    inside: np.ndarray
    rows: np.ndarray
    columns: np.ndarray

    @property
    def depth(self) -> np.ndarray:
        """Planar depth of the points [m], (...)."""
        return self.points[..., 2]


def reproject(points: np.ndarray, cam_from_points: np.ndarray, k: Pinhole) -> Reprojection:
    """Return where a camera sees points.

    Args:
        points: in the axes of another camera, or in the world [m], (n, 3).
        cam_from_points: rigid transform into the camera's axes, (4, 4), or m of them, (m, 4, 4); the results
            are then (m, n).
        k: of the camera; arrays must broadcast with (m, n).
    """
    rotations = np.swapaxes(cam_from_points[..., :3, :3], -1, -2)
    moved = points @ rotations + cam_from_points[..., None, :3, 3]
    u, v, depth = project(moved, k)
    inside = is_inside(u, v, depth, k)
    rows, columns = (np.where(inside, each, 0).astype(np.intp) for each in (v, u))
    return Reprojection(moved, inside, rows, columns)


class DepthTolerance(NamedTuple):
    """Up to which difference two depths are of the same surface: ``relative * z + absolute`` [m]."""

    relative: float
    absolute: float = 0.0

    def limit(self, depth: np.ndarray) -> np.ndarray:
        """Return the tolerance at a depth [m]."""
        return self.relative * depth + self.absolute


# The tolerances of the whole package. Right for exact poses and good depth: an error of 0.02 z is that of a
# stereo camera at four times its usual distance.
FINE = DepthTolerance(0.02)
# The usual one, for noisy depth as well: other surfaces are rarely as near to each other.
SAME_SURFACE = DepthTolerance(0.05)
# For poses that are off by up to a degree, which move a slope by several pixels.
ROUGH_POSES = DepthTolerance(0.1)


class DepthComparison(NamedTuple):
    """What depth measured by a frame says of points; where nothing was measured, nothing holds.

    Attributes:
        agrees: the frame sees the surface that the point lies on, (...), bool.
        occluded: something before the point hides it.
        seen_through: the frame sees something behind the point, which contradicts it.
    """

    agrees: np.ndarray
    occluded: np.ndarray
    seen_through: np.ndarray


def compare_depth(
    depth: np.ndarray, measured: np.ndarray, tolerance: DepthTolerance = SAME_SURFACE
) -> DepthComparison:
    """Return whether a frame that measured depth where it sees points agrees with them.

    Args:
        depth: planar depth of the points in the axes of the frame's camera [m], (...).
        measured: what the frame measured at their pixels [m], (...); NaN: unknown.
        tolerance: from which difference on they are different surfaces.
    """
    farther, limit = measured - depth, tolerance.limit(depth)
    return DepthComparison(np.abs(farther) < limit, farther <= -limit, farther >= limit)
