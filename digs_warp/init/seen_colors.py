"""The colors in which photographs see the first points."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.threads import default_threads

# Points and photographs that are looked up, evenly chosen: in a room, only one point in forty is seen often.
POINTS, FRAMES = 20000, 64
# A color is the mean of this many pixels squared: about a Gaussian's.
BLOCK = 3
# A photograph sees a point if its depth there agrees within this share of the distance.
AGREEMENT = 0.015


@dataclass(frozen=True, eq=False)
class SeenColors:
    """Some points in some photographs.

    Attributes:
        points_world: n points [m], shape (n, 3).
        centers_world: of m cameras [m], shape (m, 3).
        colors: sRGB in 0..1, NaN where a camera does not see a point, shape (n, m, 3).
    """

    points_world: np.ndarray
    centers_world: np.ndarray
    colors: np.ndarray


def look_up(
    frames: Sequence[Frame], points_world: np.ndarray, points: int = POINTS, most: int = FRAMES
) -> SeenColors:
    """Look at some of the points in some of the frames.

    Args:
        frames: with images; masks and depth maps say where a point is seen.
        points_world: on the surface, shape (n, 3).
        points: about how many to look up.
        most: about how many frames to look at.

    Raises:
        CaptureError: an image cannot be read.
    """
    some = points_world[:: max(1, len(points_world) // points)].astype(np.float64)
    looked = frames[:: max(1, len(frames) // most)]
    with ThreadPoolExecutor(default_threads()) as pool:
        seen = list(pool.map(partial(colors_in, some), looked))
    colors = np.stack(seen, axis=1) if seen else np.zeros((len(some), 0, 3))
    centers = np.array([frame.camera.center_world for frame in looked]).reshape(-1, 3)
    return SeenColors(some, centers, colors)


def colors_in(points_world: np.ndarray, frame: Frame) -> np.ndarray:
    """Return the sRGB colors in which a frame sees points, (n, 3), NaN where it does not."""
    image = frame.load_image()
    whole = frame.load_mask() == 255 if frame.has(Layer.MASK) else None
    px, z = frame.camera.project(points_world)
    height, width = image.shape[:2]
    with np.errstate(invalid="ignore"):
        place = np.floor(px)
        margin = BLOCK // 2
        inside = (z > 0) & np.all(
            (place >= margin) & (place < [width - margin, height - margin]), axis=1
        )
    columns, rows = (place[inside, axis].astype(np.int64) for axis in (0, 1))
    color, visible = np.zeros((len(rows), 3)), np.ones(len(rows), dtype=bool)
    for dy in range(-margin, margin + 1):
        for dx in range(-margin, margin + 1):
            color += image[rows + dy, columns + dx].astype(np.float64) / 255.0
            if whole is not None:
                visible &= whole[rows + dy, columns + dx]
    if frame.has(Layer.DEPTH):
        apart = np.abs(frame.load_depth()[rows, columns] - z[inside])
        visible &= apart <= AGREEMENT * z[inside]  # False where the depth is NaN
    found = np.full((len(points_world), 3), np.nan)
    found[np.flatnonzero(inside)[visible]] = color[visible] / BLOCK**2
    return found
