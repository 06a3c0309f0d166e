"""Random points: the baseline that knows nothing about the surface (paper section 4.1).

The paper does not say where its random points lie. Here they fill the cube that the cameras look at: it is
centered at the point nearest to all optical axes, and as large as the narrower side of the image at that
distance. Their colors are random, too.

In a room or a street that cube misses most. There a point lies on the viewing ray of a random pixel, in its
color, at a random depth, so every part of every image gets some.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.viewpoints import looked_at
from digs_warp.geometry.camera import Camera
from digs_warp.init.view_points import map_frames

SEED = 0


def random_points(cameras: Sequence[Camera], count: int) -> PointCloud:
    """Return ``count`` points, uniform in the cube that the cameras look at; always the same ones.

    Raises:
        DigsError: all cameras look in the same direction, so their axes have no nearest point.
    """
    center, half = cube_looked_at(cameras)
    rng = np.random.default_rng(SEED)
    offsets = rng.uniform(-1.0, 1.0, (count, 3)) * half
    return PointCloud(center + offsets, rng.uniform(0.0, 1.0, (count, 3)))


def cube_looked_at(cameras: Sequence[Camera]) -> tuple[np.ndarray, float]:
    """Return center and half the side [m] of the cube at which the cameras look, as large as they show there.

    Raises:
        DigsError: as of `looked_at`.
    """
    try:
        center = looked_at(cameras)
    except DigsError as error:
        raise DigsError(f"initialization: {error}; choose another strategy") from error
    half_sides = [
        np.linalg.norm(camera.center_world - center)
        * min(k.width / (2 * k.fx), k.height / (2 * k.fy))
        for camera in cameras
        for k in [camera.intrinsics]
    ]
    return center, float(np.median(half_sides))


# Depths lie between these multiples of the distance to what the cameras look at, evenly in their inverse, as
# surfaces do in an image.
NEAREST, FARTHEST = 0.4, 4.0


def random_points_on_rays(frames: Sequence[Frame], count: int) -> PointCloud:
    """Return ``count`` points, as many from each view as from the others; always the same ones.

    Args:
        frames: at least two, with images.
        count: at least 1.

    Raises:
        DigsError: all cameras look in the same direction, so that nothing tells how far they look.
    """
    center = looked_at([frame.camera for frame in frames])
    shares = np.diff(np.linspace(0, count, len(frames) + 1).astype(int))
    numbers = {frame.name: number for number, frame in enumerate(frames)}

    def work(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        number = numbers[frame.name]
        rng = np.random.default_rng([SEED, number])
        k = frame.camera.intrinsics
        rows, columns = (rng.integers(side, size=shares[number]) for side in (k.height, k.width))
        distance = np.linalg.norm(frame.camera.center_world - center)
        depths = distance / rng.uniform(1 / FARTHEST, 1 / NEAREST, shares[number])
        px = np.stack([columns, rows], axis=1) + 0.5
        return frame.camera.unproject(px, depths), frame.load_image()[rows, columns] / 255.0

    points, colors = zip(*map_frames(frames, work), strict=True)
    return PointCloud(np.concatenate(points), np.concatenate(colors))
