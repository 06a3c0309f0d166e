"""The colors in which photographs see the first points."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
import warp as wp

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.eyes import eyes_of
from digs_warp.device.parallel import launch_parallel
from digs_warp.device.threads import default_threads
from digs_warp.init.seen_colors_kernel import seen_colors_kernel

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
        seen = list(pool.map(partial(colors_in, some, threads=1), looked))
    colors = np.stack(seen, axis=1) if seen else np.zeros((len(some), 0, 3))
    centers = np.array([frame.camera.center_world for frame in looked]).reshape(-1, 3)
    return SeenColors(some, centers, colors)


def colors_in(points_world: np.ndarray, frame: Frame, threads: int = 0) -> np.ndarray:
    """Return the sRGB colors in which a frame sees points, (n, 3), NaN where it does not.

    Args:
        points_world: shape (n, 3).
        frame: with an image.
        threads: CPU threads; 0 means all cores.
    """
    image = frame.load_image()
    mask = frame.load_mask() if frame.has(Layer.MASK) else np.zeros((0, 0), np.uint8)
    depth = frame.load_depth() if frame.has(Layer.DEPTH) else np.zeros((0, 0), np.float32)
    found = wp.full(len(points_world), wp.vec3d(*[np.nan] * 3), dtype=wp.vec3d, device="cpu")
    inputs = [
        wp.array(np.asarray(points_world, np.float64), dtype=wp.vec3d, device="cpu"),
        eyes_of([frame.camera], [image.shape[:2]]),
        wp.array(image, dtype=wp.uint8, device="cpu"),
        wp.array(mask, dtype=wp.uint8, device="cpu"),
        wp.array(depth, dtype=float, device="cpu"),
        found,
    ]
    launch_parallel(seen_colors_kernel, len(points_world), inputs, threads=threads)
    return found.numpy()
