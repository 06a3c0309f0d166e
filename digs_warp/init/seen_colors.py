"""The colors in which photographs see the first points."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.threads import default_threads
from digs_warp.geometry.reproject import reproject

# A color is the mean of so many pixels squared, about a Gaussian's. Without depth, points hide those behind
# them in so many squared.
BLOCK, CELL = 3, 4
# A photograph sees a point if its depth there agrees within this share of the distance.
AGREEMENT = 0.015

# Points and photographs that are looked up, evenly chosen: in a room, only one point in forty is seen often.
POINTS, FRAMES = 20000, 64


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
        seen = list(pool.map(partial(colors_in, some, surface=points_world), looked))
    colors = np.stack(seen, axis=1) if seen else np.zeros((len(some), 0, 3))
    centers = np.array([frame.camera.center_world for frame in looked]).reshape(-1, 3)
    return SeenColors(some, centers, colors)


def colors_in(points_world: np.ndarray, frame: Frame, surface: np.ndarray) -> np.ndarray:
    """Return the sRGB colors in which a frame sees points (n, 3), the same shape, NaN where it does not.

    Without depth, the points of the ``surface`` (m, 3) hide what is behind them.
    """
    import cv2

    image, camera = frame.load_image(), frame.camera
    found = reproject(points_world.astype(np.float64), camera.cam_from_world, camera.intrinsics)
    at = found.rows, found.columns
    # Blocks that the mask, or the image, shows in part say nothing.
    whole = np.ones(image.shape[:2], np.uint8)
    if frame.has(Layer.MASK) or frame.has(Layer.UNKNOWN):
        whole = np.where(frame.load_shown() == 255, np.uint8(1), np.uint8(0))
    block = np.ones((BLOCK, BLOCK), np.uint8)
    whole = cv2.erode(whole, block, borderType=cv2.BORDER_CONSTANT, borderValue=[0.0])
    seen = found.inside & (whole[at] > 0)
    if frame.has(Layer.DEPTH):
        seen &= np.abs(frame.load_depth()[at] - found.depth) <= AGREEMENT * found.depth
    else:
        nearest = np.full([size // CELL + 1 for size in image.shape[:2]], np.inf)
        front = reproject(surface.astype(np.float64), camera.cam_from_world, camera.intrinsics)
        cells = front.rows[front.inside] // CELL, front.columns[front.inside] // CELL
        np.minimum.at(nearest, cells, front.depth[front.inside])
        farthest = (1.0 + AGREEMENT) * nearest[found.rows // CELL, found.columns // CELL]
        seen &= found.depth <= farthest
    sums = cv2.boxFilter(image, cv2.CV_32S, (BLOCK, BLOCK), normalize=False)
    return np.where(seen[:, None], sums[at] / (255.0 * BLOCK**2), np.nan)
