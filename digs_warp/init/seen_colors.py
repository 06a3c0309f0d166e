"""The colors in which photographs see the first points."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
import warp as wp

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.eyes import Eye, eyes_of, pixel_seen
from digs_warp.device.parallel import launch_parallel
from digs_warp.device.threads import default_threads

wp.set_module_options({"enable_backward": False})

# A color is the mean of this many pixels squared: about a Gaussian's.
BLOCK = 3
# A photograph sees a point if its depth there agrees within this share of the distance.
AGREEMENT = 0.015

_REACH = wp.constant(BLOCK // 2)
_MARGIN = wp.constant(wp.float64(BLOCK // 2))
_PIXELS = wp.constant(wp.float64(BLOCK**2))
_AGREEMENT = wp.constant(wp.float64(AGREEMENT))


@wp.kernel
def seen_colors_kernel(
    first: int,
    points: wp.array[wp.vec3d],  # [n] in the world [m]
    eyes: wp.array[Eye],  # [1]
    image: wp.array3d[wp.uint8],  # [height, width, 3] sRGB
    mask: wp.array2d[wp.uint8],  # [height, width] 255 on the object; empty: everywhere
    depth: wp.array2d[float],  # [height, width] [m], NaN: unknown; empty: not asked
    # output
    colors: wp.array[wp.vec3d],  # [n] sRGB in 0..1; those of points that are not seen stay
):
    """Look at one point."""
    i = first + wp.tid()
    eye = eyes[0]
    seen = pixel_seen(eye, points[i])
    u = wp.floor(seen[0])
    v = wp.floor(seen[1])
    inside = seen[2] > wp.float64(0.0) and u >= _MARGIN and v >= _MARGIN
    inside = inside and u < wp.float64(eye.width) - _MARGIN
    inside = inside and v < wp.float64(eye.height) - _MARGIN
    if not inside:
        return
    row = int(v)
    column = int(u)
    if depth.shape[0] > 0:
        apart = wp.abs(wp.float64(depth[row, column]) - seen[2])
        if not apart <= _AGREEMENT * seen[2]:  # also where the depth is NaN
            return
    total = wp.vec3d()
    for y in range(row - _REACH, row + _REACH + 1):
        for x in range(column - _REACH, column + _REACH + 1):
            if mask.shape[0] > 0:
                if mask[y, x] != wp.uint8(255):
                    return
            for channel in range(3):
                share = wp.float64(image[y, x, channel]) / wp.float64(255.0)
                total[channel] = total[channel] + share
    colors[i] = total / _PIXELS


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
    has_mask = frame.has(Layer.MASK) or frame.has(Layer.UNKNOWN)
    mask = frame.load_shown() if has_mask else np.zeros((0, 0), np.uint8)
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
