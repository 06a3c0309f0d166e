"""A few pairs of neighboring frames at thumbnail size: all that the checks look at."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from digs_warp.check.thumbnails import green_means
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.parallel import default_threads
from digs_warp.geometry.camera import Camera, Intrinsics

_Small = TypeVar("_Small")

# Thumbnails have at most this many columns.
WIDTH = 160

# This many pairs, evenly spread over the recording.
PAIRS = 8

# The second frame of a pair is the next one that the camera has turned this far from [degrees], or moved this
# share of the extent of its path. With less motion, wrong depth and right depth look the same.
TURN, MOVE = 10.0, 0.1

# It is among the next frames; together they are at most this share of the recording.
REACH = 0.25

# If it turned farther than this [degrees], the two frames see little in common: the least turned frame of the
# recording is taken instead, for example one of the orbit above. Angles are right in any pose convention.
TOO_FAR = 25.0


@dataclass(frozen=True, eq=False, kw_only=True)
class SmallDepth:
    """What a frame measures, at thumbnail size.

    Attributes:
        number: in the recording.
        camera: of the thumbnail.
        depth: planar z [m], (height, width), float32, NaN where unknown; every n-th pixel of the frame.
        mask: of the object, (height, width), bool; None if the frame has none.
    """

    number: int
    camera: Camera
    depth: np.ndarray
    mask: np.ndarray | None

    def points_at(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return the world points that pixels measure, (n, 3)."""
        centers = np.stack([columns + 0.5, rows + 0.5], axis=1)
        return self.camera.unproject(centers, self.depth[rows, columns].astype(np.float64))


@dataclass(frozen=True, eq=False, kw_only=True)
class SmallFrame(SmallDepth):
    """A frame at thumbnail size.

    Attributes:
        green: brightness of the green channel, 0 to 255, (height, width), float32; means over n x n pixels.
    """

    green: np.ndarray


def pixels_showing(camera: Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which pixel of a camera shows each world point, and its depth [m], both (n,).

    Pixels are indices into the flattened image; -1: the point lies outside of it.
    """
    k = camera.intrinsics
    px, depth = camera.project(points)
    inside = camera.shows(px, depth)
    columns, rows = px[inside].astype(np.intp).T
    pixel = np.full(len(depth), -1)
    pixel[inside] = rows * k.width + columns
    return pixel, depth


def small_depth(frame: Frame, number: int) -> SmallDepth:
    """Return the thumbnail of a frame that has depth; its image is not read."""
    depth = frame.load_depth()
    step = _step(*depth.shape)
    height, width = depth.shape[0] // step, depth.shape[1] // step
    picked = np.s_[step // 2 : height * step : step, step // 2 : width * step : step]
    k = frame.camera.intrinsics
    # The center of the first thumbnail pixel is the center of the first picked pixel.
    cx, cy = ((center - step // 2 - 0.5) / step + 0.5 for center in (k.cx, k.cy))
    intrinsics = Intrinsics(width, height, k.fx / step, k.fy / step, cx, cy)
    return SmallDepth(
        number=number,
        camera=Camera(intrinsics, frame.camera.world_from_cam),
        depth=depth[picked],
        mask=frame.load_mask()[picked] > 127 if frame.has(Layer.MASK) else None,
    )


def small_frame(frame: Frame, number: int) -> SmallFrame:
    """Return the thumbnail of a frame that has depth."""
    image, measured = frame.load_image(), small_depth(frame, number)
    return SmallFrame(**vars(measured), green=green_means(image, _step(*image.shape[:2])))


def _step(height: int, width: int) -> int:
    """Return how many pixels of a frame are one of its thumbnail, in each direction."""
    return min(int(np.ceil(width / WIDTH)), height, width)


def small_frames(frames: Sequence[Frame], numbers: Sequence[int]) -> dict[int, SmallFrame]:
    """Load the thumbnails of these frames on all cores; frames without depth are left out."""
    return _on_all_cores(small_frame, frames, numbers)


def small_depths(frames: Sequence[Frame], numbers: Sequence[int]) -> dict[int, SmallDepth]:
    """Load what these frames measure on all cores; frames without depth are left out."""
    return _on_all_cores(small_depth, frames, numbers)


def _on_all_cores(
    load: Callable[[Frame, int], _Small], frames: Sequence[Frame], numbers: Sequence[int]
) -> dict[int, _Small]:
    numbers = [number for number in numbers if frames[number].has(Layer.DEPTH)]
    with ThreadPoolExecutor(default_threads()) as pool:
        loaded = pool.map(lambda number: load(frames[number], number), numbers)
        return dict(zip(numbers, loaded, strict=True))


def neighbors(frames: Sequence[Frame]) -> list[tuple[int, int]]:
    """Return pairs of numbers of neighboring frames, evenly spread, with some motion between them."""
    if len(frames) < 2:
        return []
    starts = np.linspace(0, len(frames) - 2, min(PAIRS, len(frames) - 1)).round().astype(int)
    poses = np.stack([frame.camera.world_from_cam for frame in frames])
    extent = float(np.linalg.norm(np.ptp(poses[:, :3, 3], axis=0)))
    reach = max(1, int(REACH * len(frames)))
    pairs = [(i, _partner(poses, i, MOVE * extent, reach)) for i in starts.tolist()]
    return sorted({(min(pair), max(pair)) for pair in pairs})


def _partner(poses: np.ndarray, first: int, far: float, reach: int) -> int:
    """Return the number of the frame that is compared with the frame ``first``."""
    moved = np.linalg.norm(poses[:, :3, 3] - poses[first, :3, 3], axis=1)
    cosines = (np.einsum("ij,nij->n", poses[first, :3, :3], poses[:, :3, :3]) - 1) / 2
    turned = np.rad2deg(np.arccos(np.clip(cosines, -1, 1)))
    ahead = slice(first + 1, first + 1 + reach)
    enough = (turned[ahead] > TURN) | (moved[ahead] > far)
    following = first + 1 + int(np.argmax(enough)) if enough.any() else len(enough) + first
    if turned[following] <= TOO_FAR:
        return following
    turned[turned < TURN] = np.inf
    return int(np.argmin(turned))
