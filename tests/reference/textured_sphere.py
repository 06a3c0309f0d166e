"""Photographs of a textured sphere: exact color, coverage and depth from any pose, no simulator needed."""

from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.images import to_uint8
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from reference.ball_capture import on_sphere

RADIUS = 0.2  # [m]
SIZE = 96  # width and height [px]
SAMPLES = 4  # along each side of a pixel


def write_sphere_capture(folder: Path, frames: int = 12) -> Capture:
    """Write views from three rings around the sphere; its mask is the share of each pixel that it covers."""
    intrinsics = Intrinsics.from_fov(SIZE, SIZE, 32.0)
    writer = CaptureWriter(folder, intrinsics)
    for number in range(frames):
        angle = 2 * np.pi * number / frames
        eye = np.array([np.cos(angle), np.sin(angle), (-0.6, 0.0, 0.8)[number % 3]])
        camera = Camera(intrinsics, look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0])))
        writer.write_frame(number, photograph(camera))
        writer.add_pose(number, camera.world_from_cam, 0.1 * number)
    return writer.finish()


def photograph(camera: Camera) -> FrameImages:
    """Image (the sphere's own color), depth in the middle of each pixel, and mask."""
    k = camera.intrinsics
    fine = SAMPLES * k.width, SAMPLES * k.height
    depth, color = seen(camera, pixel_centers(*fine) / SAMPLES)
    shares = _mean(np.isfinite(depth)[..., None].astype(np.float64))
    mixed = _mean(np.nan_to_num(color)) / np.maximum(shares, 1e-9)
    depth, _ = seen(camera, pixel_centers(k.width, k.height))
    return FrameImages(to_uint8(mixed), depth.astype(np.float32), to_uint8(shares[..., 0]))


def seen(camera: Camera, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return planar depth [m] of the sphere, NaN beside it, and its color, of pixels (..., 2)."""
    rays, depth, _ = on_sphere(camera, pixels, RADIUS)
    return depth, texture((camera.center_world + depth[..., None] * rays) / RADIUS)


def texture(directions: np.ndarray) -> np.ndarray:
    """Color of the sphere along unit vectors (..., 3): waves of a few degrees to a third of its size."""
    rng = np.random.default_rng(1)
    value = np.full(directions.shape, 0.5)
    for frequency in (4.0, 9.0, 16.0, 30.0):
        waves = frequency * rng.normal(size=(3, 3))
        value += 0.12 * np.sin(directions @ waves + rng.uniform(0, 2 * np.pi, 3))
    return value


def _mean(fine: np.ndarray) -> np.ndarray:
    height, width, channels = fine.shape
    blocks = fine.reshape(height // SAMPLES, SAMPLES, width // SAMPLES, SAMPLES, channels)
    return blocks.mean(axis=(1, 3))
