"""Random points: the baseline that knows nothing about the surface (paper section 4.1).

The paper does not say where its random points lie. Here they fill the cube that the cameras look at: it is
centered at the point nearest to all optical axes, and as large as the narrower side of the image at that
distance. Their colors are random, too.

In a room or a street that cube misses most. There a point lies on the viewing ray of a random pixel, in its
color, so every part of every image gets some; of several random depths, the photo-consistent one counts, at
which other views show the color of the pixel, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

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
# Depths drawn for each point.
TRIES = 24

# Photographs are compared at this width [px] or less, blurred by this standard deviation [px]: the depths
# that are tried lie far apart.
WIDTH, BLUR = 320, 1.0
# A pixel is compared with this many photographs, those from the nearest places.
OTHERS = 6
# Differences of color [of 255] count up to this: beyond, another thing is seen, for something may hide the
# place.
MOST_DIFFERENCE = 40.0


@dataclass(frozen=True, eq=False)
class SmallPhoto:
    """A photograph, reduced.

    Attributes:
        camera: of the reduced photograph.
        colors: sRGB in 0..255, (height, width, 3), float32.
    """

    camera: Camera
    colors: np.ndarray

    def at(self, points_world: np.ndarray) -> np.ndarray:
        """Return the colors of points (n, 3), NaN outside of the image."""
        px, depth = self.camera.project(points_world)
        inside = self.camera.shows(px, depth)
        found = np.full((len(px), 3), np.nan, np.float32)
        columns, rows = px[inside].astype(np.intp).T
        found[inside] = self.colors[rows, columns]
        return found


def small_photo(frame: Frame) -> SmallPhoto:
    """Return a frame's photograph, reduced."""
    import cv2

    image = frame.load_image()
    height, width = image.shape[:2]
    size = (min(width, WIDTH), max(1, round(height * min(1.0, WIDTH / width))))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    return SmallPhoto(frame.camera.resized(*size), cv2.GaussianBlur(small, (0, 0), BLUR))


def nearest_photos(mine: SmallPhoto, photos: Sequence[SmallPhoto]) -> list[SmallPhoto]:
    """Return those of the other photographs that were taken from the nearest places."""
    others = [each for each in photos if each is not mine]
    apart = [np.linalg.norm(each.camera.center_world - mine.camera.center_world) for each in others]
    return [others[i] for i in np.argsort(apart, kind="stable")[:OTHERS]]


def most_consistent(
    mine: SmallPhoto, others: Sequence[SmallPhoto], tried_world: np.ndarray
) -> np.ndarray:
    """Return at which of k places on its ray each of n pixels is most photo-consistent, (n,).

    Args:
        mine: the pixels' photograph.
        others: at least one.
        tried_world: shape (k, n, 3).
    """
    tries, count = tried_world.shape[:2]
    points = tried_world.reshape(-1, 3)
    own = mine.at(points)
    total, seen = np.zeros((2, tries * count))
    for other in others:
        miss = np.minimum(np.abs(other.at(points) - own).mean(axis=1), MOST_DIFFERENCE)
        shown = np.isfinite(miss)
        total[shown] += miss[shown]
        seen += shown
    misses = np.where(seen > 0, total / np.maximum(seen, 1), MOST_DIFFERENCE)
    return misses.reshape(tries, count).argmin(axis=0)


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
    photos = list(map_frames(frames, small_photo))

    def work(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        number = numbers[frame.name]
        rng = np.random.default_rng([SEED, number])
        k = frame.camera.intrinsics
        rows, columns = (rng.integers(side, size=shares[number]) for side in (k.height, k.width))
        distance = np.linalg.norm(frame.camera.center_world - center)
        depths = distance / rng.uniform(1 / FARTHEST, 1 / NEAREST, (TRIES, shares[number]))
        px = np.stack([columns, rows], axis=1) + 0.5
        tried = np.stack([frame.camera.unproject(px, depth) for depth in depths])
        best = most_consistent(photos[number], nearest_photos(photos[number], photos), tried)
        return tried[best, np.arange(len(px))], frame.load_image()[rows, columns] / 255.0

    points, colors = zip(*map_frames(frames, work), strict=True)
    return PointCloud(np.concatenate(points), np.concatenate(colors))
