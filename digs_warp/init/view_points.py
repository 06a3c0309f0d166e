"""One view -> voxels: the conditions of eq. 9, back-projection (eq. 8) and the grid (paper section 3.3.1)."""

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import chain
from typing import TypeVar

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.device.threads import default_threads
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import grown, mask_box
from digs_warp.init.back_project import back_project
from digs_warp.init.config import InitConfig
from digs_warp.init.edges import Box, smooth_depth
from digs_warp.init.foreground import foreground_range
from digs_warp.init.voxel import VoxelSums
from digs_warp.record.progress import progress

T = TypeVar("T")


def map_frames(frames: Sequence[Frame], reduce: Callable[[Frame], T]) -> Iterator[T]:
    """Yield ``reduce`` of all frames in order, only the next few ahead: each one holds its pixels."""
    threads = default_threads()
    with (
        ThreadPoolExecutor(threads) as pool,
        progress(len(frames), "Back-projecting", "frame") as bar,
    ):
        waiting = [pool.submit(reduce, frame) for frame in frames[: 2 * threads]]
        for frame in chain(frames[2 * threads :], [None] * len(waiting)):
            yield waiting.pop(0).result()
            bar.update()
            if frame is not None:
                waiting.append(pool.submit(reduce, frame))


# The visibility check uses every n-th row and column, so that a map has about this many pixels.
KEPT_PIXELS = 100_000
# How far from its mask the object may still be, as a share of the image's width: rims are soft, and poses and
# depth a little off.
MASK_MARGIN = 0.02
# Pixels around the mask that are cut out with it: points depend on them in their last bits.
MARGIN = 3
# Depth where a ray meets nothing at all [m]: it sees through everything.
NOTHING = 1e6
# How far a ray that meets the surround sees, in terms of the surround's depth: what lies there is no object.
# What is farther may be hidden by something in front of the object.
BEYOND = 1.1

# Conditions of eq. 9 in the order in which they are applied.
FILTERS = ("in the mask", "with depth", "away from edges", "in the foreground")


@dataclass(frozen=True, eq=False)
class ViewPoints:
    """One view reduced to the grid.

    Attributes:
        name: of the frame.
        camera: of the frame.
        voxels: sums over the remaining pixels.
        pixels: how many remained after each of `FILTERS`.
        thinned_depth: of the object, see `thinned_object_depth`, for the visibility check; or None.
        seconds: CPU time of each stage [s]; "read" is the time for the files.
    """

    name: str
    camera: Camera
    voxels: VoxelSums
    pixels: dict[str, int]
    thinned_depth: np.ndarray | None
    seconds: dict[str, float]


class _Laps:
    """CPU time of the calling thread from one `lap` to the next."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.thread_time()

    def lap(self, name: str) -> None:
        now = time.thread_time()
        self.seconds[name] = self.seconds.get(name, 0.0) + now - self._last
        self._last = now


def view_points(frame: Frame, config: InitConfig, voxel_size: float) -> ViewPoints:
    """Apply the conditions of eq. 9 to one view, back-project the remaining pixels and sum them per voxel.

    Args:
        frame: a frame with image, depth and mask.
        config: which conditions.
        voxel_size: edge length of the grid [m].
    """
    laps = _Laps()
    depth, image = frame.load_depth(), frame.load_image()
    mask, unknown = frame.load_mask(), frame.load_unknown()
    laps.lap("read")
    in_mask = mask > config.mask_level
    rows, columns = box = box_of(in_mask)
    camera, near = frame.camera.cropped(rows, columns), depth[box]  # the part around the mask
    keep = in_mask[box] & ~np.isnan(near)
    pixels = {FILTERS[0]: int(np.count_nonzero(in_mask)), FILTERS[1]: int(np.count_nonzero(keep))}
    laps.lap("mask")
    if config.edge_filter:
        keep &= smooth_depth(depth, box)
    pixels[FILTERS[2]] = int(np.count_nonzero(keep))
    laps.lap("edge filter")
    if config.foreground_filter:
        votes = depth if unknown is None else np.where(unknown, np.float32(np.nan), depth)
        keep &= foreground_range(votes, in_mask).contains(near)
    pixels[FILTERS[3]] = int(np.count_nonzero(keep))
    laps.lap("foreground")
    voxels = back_project(camera, image[box], near, keep, voxel_size)
    laps.lap("back-project")
    kept = thinned_object_depth(depth, in_mask, unknown) if config.visibility_check else None
    return ViewPoints(frame.name, frame.camera, voxels, pixels, kept, laps.seconds)


def thinned(depth: np.ndarray) -> np.ndarray:
    """Return every n-th row and column of a depth map, so that it has about `KEPT_PIXELS`."""
    stride = int(np.ceil(np.sqrt(depth.size / KEPT_PIXELS)))
    return depth[::stride, ::stride].copy()


def thinned_object_depth(
    depth: np.ndarray, in_mask: np.ndarray, unknown: np.ndarray | None = None
) -> np.ndarray:
    """Return the thinned depth map, a little deeper than measured where the mask shows no object.

    What was measured there is the surround. Pixels at the rim of a mask may have its depth, too: their points
    lie on the ground, where the other views would confirm them; so they are seen through. Where nothing was
    measured, it is `NOTHING`. A view without mask pixels may just lack its mask: its depth stays.

    Args:
        depth: planar depth [m], shape (height, width), NaN where unknown.
        in_mask: the object according to the mask, same shape, bool.
        unknown: where another object may hide this one, likewise; None: nowhere.
    """
    kept, mask = thinned(depth), thinned(in_mask)
    if not mask.any():
        return kept
    known = grown(mask, MASK_MARGIN * mask.shape[1])
    if unknown is not None:
        known |= thinned(unknown)
    return np.where(known, kept, np.where(np.isnan(kept), np.float32(NOTHING), BEYOND * kept))


def box_of(in_mask: np.ndarray) -> Box:
    """Return the rows and columns around all mask pixels, with a margin; the first pixel for no mask."""
    x0, y0, x1, y1 = mask_box(in_mask)
    rows, columns = (
        slice(max(first - MARGIN, 0), min(last + MARGIN, size))
        for first, last, size in zip((y0, x0), (y1, x1), in_mask.shape, strict=True)
    )
    return (rows, columns) if x0 < x1 else (slice(0, 1), slice(0, 1))
