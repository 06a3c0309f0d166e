"""A ball in front of a wall, seen by cameras around it: closed-form depth, no simulator needed."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.rig import Rig
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at

RADIUS = 0.2
WALL_RADIUS = 3.0
BASELINE = 0.12
INTRINSICS = Intrinsics.from_fov(80, 60, 50.0)


@dataclass(frozen=True, eq=False)
class BallImages(FrameImages):
    """The pixels of a view; depth and mask are always there."""

    depth: np.ndarray = field(default_factory=lambda: np.zeros((60, 80), np.float32))
    mask: np.ndarray = field(default_factory=lambda: np.zeros((60, 80), np.uint8))


View = tuple[Camera, BallImages]


def on_sphere(
    camera: Camera, pixels: np.ndarray, radius: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rays (..., 3) with z_cam = 1, and planar depths [m] of a sphere's front and back, NaN beside it."""
    eye = camera.center_world
    rays = camera.unproject(pixels, np.ones(pixels.shape[:-1])) - eye
    a, b = (rays**2).sum(-1), rays @ eye
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b**2 - a * (eye @ eye - radius**2))
    return rays, (-b - root) / a, (-b + root) / a


def ball_view(angle: float, distance: float = 0.9) -> View:
    """A ball at the origin inside a large sphere; color = (unit normal + 1) / 2."""
    eye = distance * np.array([np.cos(angle), np.sin(angle), 0.3])
    camera = Camera(INTRINSICS, look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0])))
    directions, near, _ = on_sphere(camera, pixel_centers(80, 60), RADIUS)
    far = on_sphere(camera, pixel_centers(80, 60), WALL_RADIUS)[2]
    hit = np.isfinite(near)
    depth = np.where(hit, near, far).astype(np.float32)
    normals = (eye + near[..., None] * directions) / RADIUS
    image = np.where(hit[..., None], 127.5 * (np.nan_to_num(normals) + 1), 255).astype(np.uint8)
    mask = (255 * hit).astype(np.uint8)
    return camera, BallImages(image, depth, mask, depth_true=depth)


def ball_views(count: int = 8, distance: float = 0.9) -> list[View]:
    """Views from a ring of cameras."""
    return [ball_view(angle, distance) for angle in np.linspace(0, 2 * np.pi, count, False)]


def write_capture(folder: Path, views: list[View]) -> Capture:
    """Write the views as a capture."""
    writer = CaptureWriter(folder, INTRINSICS, Rig(BASELINE))
    for number, (camera, images) in enumerate(views):
        writer.write_frame(number, images)
        writer.add_pose(number, camera.world_from_cam, time=float(number))
    return writer.finish()


def radii(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points, axis=1)
