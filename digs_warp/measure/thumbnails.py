"""Frames at thumbnail size, for checks and votes of masks: noise is averaged away in their images."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.threads import default_threads
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.reproject import reproject, unproject_pixels
from digs_warp.geometry.rigid import transform_points

_Small = TypeVar("_Small")

# Thumbnails have at most this many columns.
WIDTH = 160


def green_means(image: np.ndarray, step: int) -> np.ndarray:
    """Return the means of the green channel over squares of ``step`` pixels, (height, width), float32."""
    height, width = image.shape[0] // step, image.shape[1] // step
    green = image[: height * step, : width * step, 1].astype(np.float32)
    rows = sum((green[row::step] for row in range(1, step)), green[::step])
    return sum((rows[:, column::step] for column in range(1, step)), rows[:, ::step]) / step**2


def thumbnails(
    frames: Sequence[Frame], thumbnail: Callable[[np.ndarray], np.ndarray]
) -> list[np.ndarray]:
    """Return what ``thumbnail`` makes of the photographs, read on all cores.

    Raises:
        DigsError: a file that cannot be read.
    """
    with ThreadPoolExecutor(default_threads()) as pool:
        return [*pool.map(lambda frame: thumbnail(frame.load_image()), frames)]


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
        depth = self.depth[rows, columns].astype(np.float64)
        points = unproject_pixels(rows, columns, depth, self.camera.intrinsics)
        return transform_points(self.camera.world_from_cam, points)


@dataclass(frozen=True, eq=False, kw_only=True)
class SmallFrame(SmallDepth):
    """A frame at thumbnail size.

    Attributes:
        green: brightness of the green channel, 0 to 255, (height, width), float32; means over n x n pixels.
    """

    green: np.ndarray

    @property
    def shown(self) -> np.ndarray:
        """Where the mask shows the object, or everywhere, (height, width), bool."""
        return np.ones(self.depth.shape, bool) if self.mask is None else self.mask

    @property
    def alone(self) -> "SmallFrame":
        """The frame with no other depth than the object's."""
        return replace(self, depth=np.where(self.shown, self.depth, np.float32(np.nan)))


def pixels_showing(camera: Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which pixel of a camera shows each world point, and its depth [m], both (n,).

    Pixels are indices into the flattened image; -1: the point lies outside of it.
    """
    k = camera.intrinsics
    seen = reproject(points, camera.cam_from_world, k)
    return np.where(seen.inside, seen.rows * k.width + seen.columns, -1), seen.depth


# A point is hidden where another one is nearer by this factor in the same of so many cells across the image.
CELLS, BEHIND = 40, 1.1


def front_points(camera: Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which of sparse points (n, 3) a camera looks at, their pixels (k, 2), and which are in front."""
    px, depth = camera.project(points)
    shown = np.flatnonzero(camera.shows(px, depth))
    k, px, depth = camera.intrinsics, px[shown], depth[shown]
    columns, rows = (px * (CELLS / k.width)).astype(int).T
    cells = (rows * CELLS + columns).clip(0)
    nearest = np.full(cells.max(initial=0) + 1, np.inf)
    np.minimum.at(nearest, cells, depth)
    return shown, px, depth <= BEHIND * nearest[cells]


def small_depth(frame: Frame, number: int) -> SmallDepth:
    """Return the thumbnail of a frame that has depth; its image is not read."""
    depth = frame.load_depth()
    step = thumbnail_step(*depth.shape)
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
    green = green_means(image, thumbnail_step(*image.shape[:2]))
    return SmallFrame(**vars(measured), green=green)


def thumbnail_step(height: int, width: int) -> int:
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
