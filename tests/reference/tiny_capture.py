"""A small capture made of rendered Gaussians: real files, a known truth, no simulator needed."""

from pathlib import Path

import numpy as np

from digs_warp.data.about import About
from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import to_uint8
from digs_warp.data.rig import UNKNOWN_EXPOSURE, CameraMotion, Exposure
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.geometry.sh import sh_from_rgb
from digs_warp.splat.camera_motion import RowMotion
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.render import render
from digs_warp.splat.surface_depth import surface_depth
from reference.ball_capture import on_sphere

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


def drawn_depth(frame: Frame) -> np.ndarray:
    """The depth [m] of the skin of the ball, NaN where there is none."""
    drawn = render(ball(), frame.camera, options=RasterOptions(outputs="depth", depth_of="skin"))
    assert drawn.depth is not None and drawn.median_depth is not None
    return surface_depth(np.stack([drawn.depth, drawn.median_depth], axis=-1))


# A shaking camera with a slow read-out: the image moves by 3 px meanwhile.
SHAKE = CameraMotion(velocity=(0.2, 0.1, 0.0), angular_velocity=(1.0, -0.8, 1.5))
READOUT_TIME = 0.04  # [s]


EXPOSURE_TIME = 0.03  # [s]


def write_tiny_capture(
    folder: Path, frames: int = 16, rolling: bool = False, blurred: bool = False
) -> Capture:
    """Write ``frames`` views of the ball from a ring of cameras; depth is that of the sphere.

    ``rolling``: every row of the photographs and masks is drawn from its own pose. ``blurred``: they are
    means over an exposure.
    """
    intrinsics = Intrinsics.from_fov(WIDTH, HEIGHT, 40.0)
    writer = CaptureWriter(folder, intrinsics)
    for number in range(frames):
        angle = 2 * np.pi * number / frames
        eye = 0.9 * np.array([np.cos(angle), np.sin(angle), 0.3 + 0.3 * (number % 3)])
        camera = Camera(intrinsics, look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0])))
        view = rolling_view if rolling else blurred_view if blurred else global_view
        image, alpha = view(camera)
        # The mask is straight alpha: the photograph shows the object before black.
        image = to_uint8(image / np.maximum(alpha, 1e-3)[..., None])
        writer.write_frame(number, FrameImages(image, sphere_depth(camera), to_uint8(alpha)))
        exposure = UNKNOWN_EXPOSURE
        if rolling or blurred:
            exposure = Exposure(SHAKE, EXPOSURE_TIME if blurred else 0.0)
        writer.add_pose(number, camera.world_from_cam, 0.1 * number, exposure=exposure)
    return writer.finish(About(readout_time=READOUT_TIME) if rolling else None)


def global_view(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Image and alpha of the ball before black."""
    view = render(ball(), camera, background=(0.0, 0.0, 0.0))
    return view.image, view.alpha


def shaken(seconds: float) -> RowMotion:
    return RowMotion(*(seconds * np.array(v) for v in (SHAKE.angular_velocity, SHAKE.velocity)))


def rolling_view(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """The same, each band of three rows from the pose at its moment."""
    rows = shaken(READOUT_TIME)
    image, alpha = np.zeros((HEIGHT, WIDTH, 3)), np.zeros((HEIGHT, WIDTH))
    for top in range(0, HEIGHT, 3):
        band = slice(top, top + 3)
        there = global_view(rows.at(camera, (top + 1.5) / HEIGHT - 0.5))
        image[band], alpha[band] = there[0][band], there[1][band]
    return image, alpha


def blurred_view(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """The same, the mean of eight moments of an exposure."""
    motion = shaken(EXPOSURE_TIME)
    views = [global_view(motion.at(camera, (i + 0.5) / 8 - 0.5)) for i in range(8)]
    image, alpha = (np.mean(planes, axis=0) for planes in zip(*views, strict=True))
    return image, alpha


def sphere_depth(camera: Camera) -> np.ndarray:
    """Planar depth [m] of the ball, NaN beside it, (HEIGHT, WIDTH), float32."""
    k = camera.intrinsics
    return on_sphere(camera, pixel_centers(k.width, k.height), RADIUS)[1].astype(np.float32)
