"""One view -> voxels: the conditions of eq. 9, back-projection (eq. 8) and the grid (paper section 3.3.1).

In a scene, pixels without depth, such as windows, shiny floors and what lies beyond the sensor's range, are
placed at the depth of the nearest pixel that has one.
"""

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
from digs_warp.init.config import MASK_THRESHOLD, InitConfig
from digs_warp.init.edges import Box, smooth_depth
from digs_warp.init.foreground import foreground_range
from digs_warp.init.levels import Levels
from digs_warp.init.start import Subject
from digs_warp.init.voxel import Voxels
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

# Conditions of eq. 9 in their order; of a scene the first is "in view", and there is no last.
FILTERS = ("in the mask", "with depth", "away from edges", "in the foreground")
IN_VIEW = "in view"

# Guessed surfaces get grids coarser by this many levels than measured ones: more detail would be invented.
GUESS_COARSER = 1

# Voxels by the number of their grid.
Sums = dict[int, Voxels]


@dataclass(frozen=True, eq=False)
class ViewPoints:
    """One view reduced to the grids.

    Attributes:
        name: of the frame.
        camera: of the frame.
        measured: sums over the remaining pixels.
        guessed: of a scene: sums over pixels without depth, placed at that of the nearest pixel with depth.
        pixels: how many remained after each of `FILTERS`.
        thinned_depth: for the visibility check; of an object see `thinned_object_depth`.
        beside: depth beside the image [m], likewise; 0: unknown.
    """

    name: str
    camera: Camera
    measured: Sums
    guessed: Sums
    pixels: dict[str, int]
    thinned_depth: np.ndarray
    beside: float


def view_points(frame: Frame, config: InitConfig, levels: Levels, subject: Subject) -> ViewPoints:
    """Apply the conditions of eq. 9 to one view, back-project the remaining pixels and sum them per voxel.

    In a scene nothing is left out as background. Its edge filter looks at inverse depth: on a floor that
    recedes, depth curves, inverse depth does not, and the noise of stereo is the same near and far.

    Args:
        frame: a frame with image and depth, of an object with mask.
        config: which conditions.
        levels: which grid for which distance.
        subject: what is reconstructed.
    """
    frame = frame.every(levels.stride)
    depth, image, unknown = frame.load_depth(), frame.load_image(), frame.load_unknown()
    mask = frame.load_mask() if subject == "object" else None
    known = ~np.isnan(depth)
    in_mask = np.ones(depth.shape, bool) if mask is None else mask > MASK_THRESHOLD
    box = box_of(in_mask)  # the part that is looked at
    keep = in_mask[box] & known[box]
    pixels = {IN_VIEW if mask is None else FILTERS[0]: int(np.count_nonzero(in_mask))}
    pixels[FILTERS[1]] = int(np.count_nonzero(keep))
    if config.edge_filter:
        keep &= smooth_depth(1.0 / depth if mask is None else depth, box)
    pixels[FILTERS[2]] = int(np.count_nonzero(keep))
    guessed: Sums = {}
    if mask is None:
        unmeasured = ~known if unknown is None else ~(known | unknown)
        places = nearest_known(depth)
        guessed = _on_levels(frame.camera, image, places, unmeasured, levels, GUESS_COARSER)
        kept, beside = thinned(depth), 0.0
    else:
        votes = depth if unknown is None else np.where(unknown, np.float32(np.nan), depth)
        nearest, farthest = foreground_range(votes, in_mask)
        keep &= (depth[box] >= nearest) & (depth[box] <= farthest)
        pixels[FILTERS[3]] = int(np.count_nonzero(keep))
        kept = thinned_object_depth(depth, in_mask, unknown)
        beside = NOTHING if shows_whole(in_mask, unknown) else 0.0
    near = frame.camera.cropped(*box)
    measured = _on_levels(near, image[box], depth[box], keep, levels, 0)
    return ViewPoints(frame.name, frame.camera, measured, guessed, pixels, kept, beside)


def _on_levels(
    camera: Camera,
    image: np.ndarray,
    depth: np.ndarray,
    keep: np.ndarray,
    levels: Levels,
    coarser: int,
) -> Sums:
    keep = keep & ~np.isnan(depth)
    level = levels.of_depth(depth, camera.intrinsics.fx) + coarser
    return {
        int(n): back_project(camera, image, depth, keep & (level == n), levels.edge(int(n)))
        for n in np.flatnonzero(np.bincount(level[keep]))
    }


def nearest_known(depth: np.ndarray) -> np.ndarray:
    """Return the depth with each unknown value, NaN, replaced by that of the nearest known pixel.

    All of it stays NaN where nothing is known.
    """
    from scipy.ndimage import distance_transform_edt

    unknown = np.isnan(depth)
    if unknown.all() or not unknown.any():
        return depth
    places = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    rows, columns = np.asarray(places)
    return depth[rows, columns]


def thinned(depth: np.ndarray) -> np.ndarray:
    """Return every n-th row and column of a depth map, in the middle of n: about `KEPT_PIXELS`."""
    stride = int(np.ceil(np.sqrt(depth.size / KEPT_PIXELS)))
    return depth[(stride - 1) // 2 :: stride, (stride - 1) // 2 :: stride].copy()


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


def shows_whole(in_mask: np.ndarray, unknown: np.ndarray | None = None) -> bool:
    """Whether neither the border of the image nor another object cuts the object; arguments as above."""
    height, width = in_mask.shape
    margin = MASK_MARGIN * width
    x0, y0, x1, y1 = mask_box(in_mask)
    inside = margin < min(x0, y0) and x1 < width - margin and y1 < height - margin
    return inside and (unknown is None or not np.any(grown(in_mask, margin) & unknown))


def box_of(in_mask: np.ndarray) -> Box:
    """Return the rows and columns around all mask pixels, with a margin; the first pixel for no mask."""
    x0, y0, x1, y1 = mask_box(in_mask)
    rows, columns = (
        slice(max(first - MARGIN, 0), min(last + MARGIN, size))
        for first, last, size in zip((y0, x0), (y1, x1), in_mask.shape, strict=True)
    )
    return (rows, columns) if x0 < x1 else (slice(0, 1), slice(0, 1))
