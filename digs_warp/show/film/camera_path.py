"""Camera paths for films: once around the object, or along the path of a recording."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, rigid

UP = np.array([0.0, 0.0, 1.0])

# Fainter Gaussians, and the outermost percent along each axis, are ignored when looking for the object.
LEAST_OPACITY = 0.1
OUTLIERS_PERCENT = 1.0

# A part of the object is at most this many radii of its bulk away, and has more than this share.
FARTHEST_PART = 2.0
STRAYS_PERCENT = 0.02

# Free space around the object: the ball is enlarged by this factor.
MARGIN = 1.1


@dataclass(frozen=True, eq=False)
class Subject:
    """What a film shows: a ball in the world [m]."""

    center_world: np.ndarray
    radius: float


def find_subject(gaussians: Gaussians) -> Subject:
    """Return the ball around the bulk of the visible Gaussians.

    Raises:
        DigsError: there are no Gaussians.
    """
    if not len(gaussians):
        raise DigsError("film: there are 0 Gaussians, nothing to show")
    visible = gaussians.opacities >= LEAST_OPACITY
    bulk = _bulk(_visible_means(gaussians))
    largest = float(gaussians.scales[visible].max(initial=0.0)) if len(gaussians) == 1 else 0.0
    return Subject(bulk.center_world, max(bulk.radius, 3.0 * largest, 1e-6))


def _bulk(points: np.ndarray) -> Subject:
    low, high = np.percentile(points, [OUTLIERS_PERCENT, 100 - OUTLIERS_PERCENT], axis=0)
    center = 0.5 * (low + high)
    radius = np.percentile(np.linalg.norm(points - center, axis=1), 100 - OUTLIERS_PERCENT)
    return Subject(center, float(radius))


def find_framed_points(points: np.ndarray) -> Subject:
    """Return the ball around points, shape (n, 3), n > 0, with their thin parts, without strays."""
    found = with_thin_parts(points, _bulk(points))
    return Subject(found.center_world, max(found.radius, 1e-6))


def find_framed_subject(gaussians: Gaussians) -> Subject:
    """Return the ball around the object with its thin parts, for a picture of all of it.

    Raises:
        DigsError: there are no Gaussians.
    """
    return with_thin_parts(_visible_means(gaussians), find_subject(gaussians))


def with_thin_parts(points: np.ndarray, bulk: Subject) -> Subject:
    """Return a ball that holds thin parts, too, such as a handle.

    They can hold less than a percent of the points, as strays do, which lie farther away.

    Args:
        points: shape (n, 3).
        bulk: the ball around most of them.
    """
    near = points[np.linalg.norm(points - bulk.center_world, axis=1) <= FARTHEST_PART * bulk.radius]
    if len(near) < 2:
        return bulk
    low, high = np.percentile(near, [STRAYS_PERCENT, 100 - STRAYS_PERCENT], axis=0)
    center = 0.5 * (low + high)
    radius = np.percentile(np.linalg.norm(near - center, axis=1), 100 - STRAYS_PERCENT)
    return Subject(center, max(float(radius), bulk.radius))


def _visible_means(gaussians: Gaussians) -> np.ndarray:
    visible = gaussians.opacities >= LEAST_OPACITY
    return gaussians.means[visible] if visible.any() else gaussians.means


def orbit(
    subject: Subject,
    intrinsics: Intrinsics,
    frames: int,
    elevation_deg: float = 20.0,
    up: np.ndarray = UP,
) -> list[Camera]:
    """Return ``frames`` cameras evenly spread over one turn around the vertical through the subject.

    The distance is such that the subject's ball fills the smaller side of the image.

    Args:
        subject: what to look at.
        intrinsics: of all cameras.
        frames: at least 1.
        elevation_deg: angle of the camera above the horizon, above -90 and below 90.
        up: what is up in the world, of length 1, shape (3,).

    Raises:
        DigsError: an elevation from which "up" is not defined, or no frames.
    """
    if not -90 < elevation_deg < 90:
        raise DigsError(
            f"orbit: elevation {elevation_deg} degrees, expected above -90 and below 90"
        )
    if frames < 1:
        raise DigsError(f"orbit: {frames} frames, expected at least 1")
    half = 0.5 * min(intrinsics.width / intrinsics.fx, intrinsics.height / intrinsics.fy)
    distance = MARGIN * subject.radius / np.sin(np.arctan(half))
    elevation = np.deg2rad(elevation_deg)
    east = _level_axis(up)
    north = np.cross(up, east)
    cameras = []
    for azimuth in np.arange(frames) * (2 * np.pi / frames):
        level = np.cos(azimuth) * east + np.sin(azimuth) * north
        direction = np.cos(elevation) * level + np.sin(elevation) * up
        eye = subject.center_world + distance * direction
        cameras.append(Camera(intrinsics, look_at(eye, subject.center_world, up)))
    return cameras


def _level_axis(up: np.ndarray) -> np.ndarray:
    """Return the horizontal unit vector nearest to x, or to y where x is upright."""
    axis = np.array([1.0, 0.0, 0.0] if abs(up[0]) < 0.9 else [0.0, 1.0, 0.0])
    level = axis - (axis @ up) * up
    return level / np.linalg.norm(level)


def up_of(cameras: Sequence[Camera]) -> np.ndarray:
    """Return what is up in the world of a recording, shape (3,): z, unless its cameras say otherwise.

    Worlds that begin at the first camera have y down. People hold cameras upright, so the axis nearest to
    the mean of what is up in the images is up; it is z up to steep views from one side.
    """
    if not len(cameras):
        return UP
    found = np.mean([-camera.world_from_cam[:3, 1] for camera in cameras], axis=0)
    if not np.linalg.norm(found) or found[2] > 0.3 * np.linalg.norm(found):
        return UP
    axis = int(np.abs(found).argmax())
    return np.sign(found[axis]) * np.eye(3)[axis]


def along(
    poses: Sequence[np.ndarray], times: Sequence[float], intrinsics: Intrinsics, frames: int
) -> list[Camera]:
    """Return ``frames`` cameras evenly spread in time along a recorded path, ends included.

    Positions follow a cubic spline through the recorded ones, orientations turn evenly between them.

    Args:
        poses: recorded ``world_from_cam``, (4, 4) each, at least one.
        times: when they were recorded [s], increasing.
        intrinsics: of all cameras.
        frames: at least 1.

    Raises:
        DigsError: times that do not increase, or no poses or frames.
    """
    from scipy.interpolate import CubicSpline
    from scipy.spatial.transform import Rotation, Slerp

    if not len(poses) or frames < 1:
        raise DigsError(f"camera path: {len(poses)} poses, {frames} frames, expected at least 1")
    if len(poses) == 1:
        return [Camera(intrinsics, poses[0])] * frames
    if not (np.diff(times) > 0).all():
        raise DigsError(
            "camera path: the times of the capture do not increase; correct 'time' in transforms.json"
        )
    matrices = np.asarray(poses, dtype=np.float64)
    moments = np.linspace(times[0], times[-1], frames)
    positions = CubicSpline(times, matrices[:, :3, 3])(moments)
    rotations = Slerp(times, Rotation.from_matrix(matrices[:, :3, :3]))(moments).as_matrix()
    return [Camera(intrinsics, rigid(r, p)) for r, p in zip(rotations, positions, strict=True)]


def same_width_of_view(recorded: Intrinsics, width: int, height: int) -> Intrinsics:
    """Return a centered camera of another size [px] that sees as far to the sides as ``recorded``."""
    focal = recorded.fx * width / recorded.width
    return Intrinsics(width, height, fx=focal, fy=focal, cx=width / 2, cy=height / 2)
