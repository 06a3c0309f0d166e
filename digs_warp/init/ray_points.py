"""Random points of a scene: on the viewing rays of random pixels, in their colors.

A cube around what the cameras look at misses most of a room or a street, and its points have no color. A
point on the ray of a pixel has the right color in one view at least, and every part of every image gets some.
Of several random depths, the one counts at which other views show the color of the pixel, too.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.in_order import in_order
from digs_warp.init.random_points import SEED, looked_at
from digs_warp.init.seen_alike import look, most_alike, nearest_looks

# Depths lie between these multiples of the distance to what the cameras look at, evenly in their inverse, as
# surfaces do in an image.
NEAREST, FARTHEST = 0.4, 4.0
# Depths drawn for each point.
TRIES = 24


def ray_points(frames: Sequence[Frame], count: int) -> PointCloud:
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
    looks = list(in_order(frames, look))

    def work(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        number = numbers[frame.name]
        rng = np.random.default_rng([SEED, number])
        k = frame.camera.intrinsics
        rows, columns = (rng.integers(side, size=shares[number]) for side in (k.height, k.width))
        distance = np.linalg.norm(frame.camera.center_world - center)
        depths = distance / rng.uniform(1 / FARTHEST, 1 / NEAREST, (TRIES, shares[number]))
        px = np.stack([columns, rows], axis=1) + 0.5
        tried = np.stack([frame.camera.unproject(px, depth) for depth in depths])
        best = most_alike(looks[number], nearest_looks(looks[number], looks), tried)
        return tried[best, np.arange(len(px))], frame.load_image()[rows, columns] / 255.0

    points, colors = zip(*in_order(frames, work), strict=True)
    return PointCloud(np.concatenate(points), np.concatenate(colors))
