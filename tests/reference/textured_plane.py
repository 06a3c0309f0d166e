"""Pictures of a textured plane with a bump: exact color and depth from any pose, without files."""

import numpy as np

from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.poses.views import Picture

INTRINSICS = Intrinsics.from_fov(160, 120, 50.0)


def ring_of_poses(count: int) -> np.ndarray:
    """``world_from_cam`` of cameras above the plane z = 0 that look at the origin, (count, 4, 4)."""
    angles = 2 * np.pi * np.arange(count) / count
    eyes = np.stack([0.4 * np.cos(angles), 0.4 * np.sin(angles), 0.7 + 0.1 * np.cos(3 * angles)], 1)
    return np.stack([look_at(eye, np.zeros(3), np.array([0.0, 1.0, 0.0])) for eye in eyes])


def picture(pose: np.ndarray) -> Picture:
    """What a camera sees of the plane; a wave of 2 cm makes it uneven."""
    k = INTRINSICS
    camera = Camera(k, pose)
    px = pixel_centers(k.width, k.height)
    depth = np.ones((k.height, k.width))
    for _ in range(30):  # moves along the ray until it meets the surface
        points = camera.unproject(px, depth)
        slope = camera.unproject(px, depth + 1.0)[..., 2] - points[..., 2]
        depth = depth + (_height(points) - points[..., 2]) / slope
    points = camera.unproject(px, depth)
    still = np.zeros(3)
    gray = np.full((k.height, k.width, 2), 1 / 3, np.float32)
    return Picture(k, _texture(points), depth.astype(np.float32), gray, still, still)


def _height(points: np.ndarray) -> np.ndarray:
    return 0.02 * np.sin(8 * points[..., 0]) * np.cos(6 * points[..., 1])


def _texture(points: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(3)
    value = np.full(points.shape[:2], 0.5)
    for _ in range(24):
        across, along, phase = rng.normal(size=2) * 60, rng.uniform(0, 2 * np.pi), 0.04
        value += phase * np.sin(points[..., 0] * across[0] + points[..., 1] * across[1] + along)
    return value.astype(np.float32)
