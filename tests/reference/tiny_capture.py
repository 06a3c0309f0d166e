"""A small capture made of rendered Gaussians: real files, a known truth, no simulator needed."""

from pathlib import Path

import numpy as np

from digs_warp.camera import Camera, Intrinsics
from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import to_uint8
from digs_warp.geometry import look_at
from digs_warp.sh import sh_from_rgb
from digs_warp.splat.render import render

WIDTH, HEIGHT = 72, 54
RADIUS = 0.2  # [m]


def ball(count: int = 1500) -> Gaussians:
    """A ball whose color changes smoothly along its surface."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(count, 3))
    points *= RADIUS / np.linalg.norm(points, axis=1, keepdims=True)
    rgb = 0.5 + 0.4 * np.sin(points / RADIUS * [4.0, 5.0, 6.0])
    return Gaussians(
        means=points,
        log_scales=np.full((count, 3), np.log(0.012)),
        quats=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        opacity_logits=np.full(count, 4.0),
        sh=sh_from_rgb(rgb)[:, None],
    )


def write_tiny_capture(folder: Path, frames: int = 16) -> Capture:
    """Write ``frames`` views of the ball from a ring of cameras; depth is that of the sphere."""
    intrinsics = Intrinsics.from_fov(WIDTH, HEIGHT, 40.0)
    writer = CaptureWriter(folder, intrinsics)
    for number in range(frames):
        angle = 2 * np.pi * number / frames
        eye = 0.9 * np.array([np.cos(angle), np.sin(angle), 0.3 + 0.3 * (number % 3)])
        camera = Camera(intrinsics, look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0])))
        view = render(ball(), camera, background=(0.0, 0.0, 0.0))
        # The mask is straight alpha: the photograph shows the object before black.
        share = np.maximum(view.alpha, 1e-3)[..., None]
        image = to_uint8(view.image / share)
        images = FrameImages(image, sphere_depth(camera), to_uint8(view.alpha))
        writer.write_frame(number, images)
        writer.add_pose(number, camera.world_from_cam, 0.1 * number)
    return writer.finish()


def sphere_depth(camera: Camera) -> np.ndarray:
    """Planar depth [m] of the ball, NaN beside it, (HEIGHT, WIDTH), float32."""
    k = camera.intrinsics
    u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
    rays = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u)], axis=-1)
    center = camera.cam_from_world[:3, 3]
    a, b = (rays**2).sum(-1), rays @ center
    root = b**2 - a * (center @ center - RADIUS**2)
    with np.errstate(invalid="ignore"):
        return ((b - np.sqrt(root)) / a).astype(np.float32)
