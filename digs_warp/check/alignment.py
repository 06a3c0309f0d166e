"""Depth, images and masks that do not lie over each other: moved, cut, inverted, or contradicted.

The edges of depth that is not registered are offset from those of the images
(`digs_warp.check.registration`). Masks that are shifted, or that cut the object, have outlines offset from
the depth steps. Where depth is too noisy for edges, masks tell of both.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from digs_warp.check import thresholds as limits
from digs_warp.check.evidence import Evidence
from digs_warp.check.registration import LOOKED_AT, registration
from digs_warp.check.thresholds import Threshold
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import evenly
from digs_warp.measure.thumbnails import SmallFrame, small_depths, small_frames
from digs_warp.words import counted

# The depth of a Kinect or its like is so much larger than its color image shows it, unless it is registered.
KINECT_SCALE, KINECT_SPREAD = 525 / 585, 0.03
KINECT = (
    " Such is the depth of a Kinect, Xtion or PrimeSense that was recorded without registration: "
    "--register-depth kinect."
)

# Outlines are moved and grown by up to this many thumbnail pixels.
REACH = 8

# Masks that are looked at, evenly spread, for whether they mark anything.
MASKS = 10

# Half the width of an outline [thumbnail px].
HALF_WIDTH = 0.75


def depth_elsewhere(evidence: Evidence, least: Threshold) -> dict[str, Any] | None:
    """Find depth that fits the images better after a shift by this [of the width], or at another size."""
    whole = [replace(frame, alone=False) for frame in evidence.capture.frames]
    frames = small_frames(whole, evenly(range(len(whole)), LOOKED_AT)).values()
    found = registration((frame.green, frame.depth) for frame in frames)
    if found is None or found.certainty < limits.REGISTRATION_CERTAINTY:
        return None
    size = abs(np.log(found.scale))
    if np.hypot(found.right, found.down) < least and size < limits.REGISTRATION_SIZE:
        return None
    return {
        "move": found,
        "kinect": KINECT if abs(found.scale - KINECT_SCALE) < KINECT_SPREAD else "",
    }


def moved_by(right: int, down: int, frame: SmallFrame) -> str:
    """Say how far a move by thumbnail pixels is."""
    width = frame.depth.shape[1]
    return (
        f"{abs(right) / width:.1%} of the width to the {'right' if right > 0 else 'left'} and "
        f"{abs(down) / width:.1%} {'down' if down > 0 else 'up'}"
    )


def masks_of_nothing(evidence: Evidence, least: Threshold) -> dict[str, Any] | None:
    """Find masks that mark less than this share of the image, or almost no pixel (median)."""
    frames = [frame for frame in evidence.capture.frames if frame.has(Layer.MASK)]
    if not (frames and evidence.uses_masks):
        return None
    some = frames[:: -(-len(frames) // MASKS)]
    marked = [np.count_nonzero(frame.load_mask() > 127) for frame in some]
    size = some[0].camera.intrinsics.width * some[0].camera.intrinsics.height
    pixels = float(np.median(marked))
    is_little = pixels < min(limits.LEAST_MASK, least * size)
    return {"pixels": f"{pixels:,.0f} of {size:,}"} if is_little else None


def masks_inverted(evidence: Evidence, share: Threshold) -> dict[str, Any] | None:
    """Find masks that mark the surroundings: more than this share of them."""
    frames = [frame for frame in evidence.frames.values() if frame.mask is not None]
    inverted = sum(map(_is_inverted, frames)) if evidence.uses_masks else 0
    return {"inverted": inverted, "count": len(frames)} if inverted > share * len(frames) else None


def _is_inverted(frame: SmallFrame) -> bool:
    mask = frame.mask
    assert mask is not None
    border = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
    marked, left_out = (frame.depth[where & np.isfinite(frame.depth)] for where in (mask, ~mask))
    covers = border.mean() >= limits.INVERTED_BORDER and (~mask).mean() >= limits.INVERTED_HOLE
    if not (covers and marked.size and left_out.size):
        return False
    return bool(np.median(left_out) < np.median(marked))


def masks_cut(evidence: Evidence, larger: Threshold) -> dict[str, Any] | None:
    """Find masks that cut the object: along larger outlines, the depth bends this many times more."""
    fit = evidence.once(outlines)
    if fit is None or not _cuts(fit, larger):
        return None
    frame = next(iter(evidence.frames.values()))
    return {"cut": fit.cut / frame.depth.shape[1]}


def masks_moved(evidence: Evidence, moved: Threshold) -> dict[str, Any] | None:
    """Find masks along whose moved outlines the depth bends this many times more, and the images fit, too."""
    fit = evidence.once(outlines)
    if fit is None or not _is_moved(fit, moved) or fit.image < 1:
        return None
    return {"move": moved_by(fit.right, fit.down, next(iter(evidence.frames.values())))}


def depth_beside_masks(evidence: Evidence, moved: Threshold) -> dict[str, Any] | None:
    """Find depth offset from the masks where the masks fit the images: then the depth was shifted."""
    fit = evidence.once(outlines)
    if fit is None or not _is_moved(fit, moved) or fit.image >= 1:
        return None
    frame = next(iter(evidence.frames.values()))
    return {"move": moved_by(-fit.right, -fit.down, frame), "kinect": ""}


def _cuts(fit: "OutlineFit", larger: float) -> bool:
    is_cut = fit.cut >= limits.LEAST_OUTLINE_OFFSET and fit.larger > larger
    return is_cut and (fit.larger >= fit.moved or not fit.offset)


def _is_moved(fit: "OutlineFit", moved: float) -> bool:
    return fit.offset >= limits.LEAST_OUTLINE_OFFSET and fit.moved > moved


def masks_contradicted(evidence: Evidence, _: Threshold) -> dict[str, Any] | None:
    """Find single masks that most other views contradict; the limit is that of `digs_warp.masks.votes`."""
    capture, needed = evidence.capture, (Layer.MASK, Layer.DEPTH)
    numbers = [n for n, frame in enumerate(capture.frames) if all(map(frame.has, needed))]
    if not (evidence.knows_poses and numbers):
        return None
    from digs_warp.masks.votes import contradicted, mask_votes  # loads Warp

    votes = mask_votes([*small_depths(capture.frames, numbers).values()])
    names = [capture.frames[numbers[outlier]].name for outlier in contradicted(votes)]
    if not names:
        return None
    masks = counted(len(names), "mask")
    return {"masks": masks, "count": len(numbers), "names": ", ".join(names)}


def outlines(evidence: Evidence) -> "OutlineFit | None":
    """Return how the outlines of the masks fit the depth."""
    return outline_fit([*evidence.frames.values()]) if evidence.uses_masks else None


@dataclass(frozen=True)
class OutlineFit:
    """How the outlines of the masks fit the depth best.

    Attributes:
        right: move of the outlines [thumbnail px], from -REACH to REACH.
        down: the same, downward.
        moved: how many times more the depth bends along the outlines after this move.
        grown: pixels by which the masks are too small, from -REACH to REACH.
        larger: how many times more the depth bends along the outlines of masks that are so much larger.
        image: how many times steeper the images are along the outlines after the move.
    """

    right: int
    down: int
    moved: float
    grown: int
    larger: float
    image: float

    @property
    def offset(self) -> int:
        """The larger of both moves; 0 where it lies at the end of the range, which is no peak."""
        offset = max(abs(self.right), abs(self.down))
        return offset if offset < REACH else 0

    @property
    def cut(self) -> int:
        """Pixels that the masks lack all around; 0 where it lies at the end of the range."""
        return self.grown if 0 < self.grown < REACH else 0


def outline_fit(frames: Sequence[SmallFrame]) -> OutlineFit | None:
    """Return how the outlines fit best; None if too few frames show an outline and depth."""
    seen = [found for frame in frames if (found := _along_outline(frame)) is not None]
    if len(seen) < max(limits.LEAST_OUTLINES, len(frames) / 2):
        return None
    moved, grown, image = (np.mean([each[i] for each in seen], axis=0) for i in range(3))
    row, column = np.unravel_index(int(np.argmax(moved)), moved.shape)
    best = int(np.argmax(grown))
    return OutlineFit(
        right=int(column) - REACH,
        down=int(row) - REACH,
        moved=_ratio(moved[row, column], moved[REACH, REACH]),
        grown=best - REACH,
        larger=_ratio(grown[best], grown[REACH]),
        image=_ratio(image[row, column], image[REACH, REACH]),
    )


def _along_outline(frame: SmallFrame) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return means along the outline of the mask: bend after moves, after growing, steepness after moves."""
    mask = frame.mask
    if mask is None or min(mask.shape) <= 2 * REACH + 2:
        return None
    distance = _distance(mask)
    bend, steepness = _bend(frame.depth), np.hypot(*np.gradient(frame.green))
    inner = np.zeros(mask.shape, dtype=bool)
    inner[REACH:-REACH, REACH:-REACH] = True
    rings = [inner & (np.abs(distance - by) <= HALF_WIDTH) for by in range(-REACH, REACH + 1)]
    rows, columns = np.nonzero(rings[REACH])
    if np.isfinite(bend[rows, columns]).sum() < limits.LEAST_OUTLINE_PIXELS:
        return None
    bends, slopes = (_moved(each, rows, columns, REACH) for each in (bend, steepness))
    return _mean(bends), np.array([_mean(bend[ring]) for ring in rings]), _mean(slopes)


def _moved(image: np.ndarray, rows: np.ndarray, columns: np.ndarray, reach: int) -> np.ndarray:
    """Return an image at places after each move by up to ``reach`` pixels, (down, right, places)."""
    moves = np.arange(-reach, reach + 1)
    places = rows * image.shape[1] + columns
    return image.ravel()[(moves[:, None] * image.shape[1] + moves)[..., None] + places]


def _distance(mask: np.ndarray) -> np.ndarray:
    """Return the distance to the outline [px], below 0 inside, (height, width)."""
    return np.where(mask, 0.5 - _distance_to(~mask), _distance_to(mask) - 0.5)


def _distance_to(pixels: np.ndarray) -> np.ndarray:
    """Return the distance to the nearest of some pixels, a bool mask; far where there are none."""
    import cv2

    if not pixels.any():
        return np.full(pixels.shape, np.inf)
    away = (~pixels).astype(np.uint8)
    return cv2.distanceTransform(away, cv2.DIST_L2, cv2.DIST_MASK_PRECISE).astype(np.float64)


def _bend(depth: np.ndarray) -> np.ndarray:
    """Return how much the inverse depth bends, 0 to 1, NaN where unknown, (height, width)."""
    inverse = 1.0 / depth
    across, down = np.full_like(depth, np.nan), np.full_like(depth, np.nan)
    across[:, 1:-1] = inverse[:, 2:] - 2 * inverse[:, 1:-1] + inverse[:, :-2]
    down[1:-1] = inverse[2:] - 2 * inverse[1:-1] + inverse[:-2]
    return np.minimum(np.fmax(np.abs(across), np.abs(down)) * depth / limits.FULL_BEND, 1.0)


def _mean(values: np.ndarray) -> np.ndarray:
    """Return the mean of what is known along the last axis; 0 where that is little."""
    known = np.isfinite(values)
    count = np.count_nonzero(known, axis=-1)
    sums = np.where(known, values, 0.0).sum(axis=-1)
    return np.where(count >= limits.LEAST_OUTLINE_PIXELS, sums / np.maximum(count, 1), 0.0)


def _ratio(best: float, now: float) -> float:
    return float(best / now) if now > 0 else (np.inf if best > 0 else 1.0)
