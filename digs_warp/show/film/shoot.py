"""Render a camera path frame by frame, and measure how fast."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import to_uint8
from digs_warp.geometry.camera import Camera
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.renderer import SplatRenderer

WHITE = (1.0, 1.0, 1.0)


@dataclass
class Clock:
    """Seconds of every frame rendered so far; the first loads or compiles kernels."""

    seconds: list[float] = field(default_factory=list)

    @property
    def milliseconds(self) -> float:
        """Mean time of a frame [ms], without the first if there are others; NaN if there are none."""
        counted = self.seconds[1:] or self.seconds
        return 1e3 * float(np.mean(counted)) if counted else float("nan")

    @property
    def frame_rate(self) -> float:
        """Frames per second of rendering alone."""
        return 1e3 / self.milliseconds


def shoot(
    gaussians: Gaussians,
    cameras: Sequence[Camera],
    *,
    background: tuple[float, float, float] = WHITE,
    center_world: np.ndarray | None = None,
    device: str = "cpu",
    threads: int = 0,
    clock: Clock | None = None,
) -> Iterator[np.ndarray]:
    """Yield the frames of a film, sRGB, shape (height, width, 3), uint8.

    Args:
        gaussians: the scene.
        cameras: one per frame, all of one image size.
        background: sRGB color behind the Gaussians, 0..1.
        center_world: where the scene is, for the near plane [m]; default: the mean of the Gaussians.
        device: "cpu" or a CUDA device of Warp.
        threads: CPU threads; 0: all cores.
        clock: collects the time of each frame, from the camera to the pixels in memory.

    Raises:
        DigsError: cameras of different image sizes.
    """
    if not cameras:
        return
    k = cameras[0].intrinsics
    if any((c.intrinsics.width, c.intrinsics.height) != (k.width, k.height) for c in cameras):
        raise DigsError("film: cameras of different image sizes; a film has one")
    if center_world is not None:
        center = center_world
    else:
        center = gaussians.means.mean(axis=0) if len(gaussians) else np.zeros(3)
    splats = DeviceGaussians.from_numpy(gaussians, device)
    renderer = SplatRenderer(splats, k.width, k.height, threads=threads)
    for camera in cameras:
        start = time.perf_counter()
        renderer.forward(camera, near=near_plane(camera, center), background=background)
        frame = to_uint8(renderer.image.to_numpy())
        if clock is not None:
            clock.seconds.append(time.perf_counter() - start)
        yield frame
