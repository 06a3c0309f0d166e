"""Things that move while they are recorded: frames see through what others saw.

Wrong depth looks the same: glass, mirrors, plain surfaces. But there the other frame explains the color: it
shows what is really behind, and the pixel has its color. Something that moved has another color.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from digs_warp.check import thresholds as limits
from digs_warp.check.evidence import Evidence, Pairs, brightness_ratio
from digs_warp.measure.thumbnails import SmallFrame, pixels_showing

# What a frame shows around a pixel: within this many thumbnail pixels, for poses and edges of depth are not
# exact.
AROUND = 2


def moving_things(evidence: Evidence, most: float) -> dict[str, Any] | None:
    """Find pairs of frames in one of which more than this share of the points of the other are gone."""
    share = moved_share(evidence.compared, evidence.pairs)
    return {"share": share} if share > most else None


def moved_share(frames: Mapping[int, SmallFrame], pairs: Pairs) -> float:
    """Return the share of points that are gone in the other frame, 0 to 1: the mean over the pairs."""
    shares = [
        gone_share(frames[first], frames[second])
        for pair in pairs
        for first, second in (pair, pair[::-1])
    ]
    return float(np.mean(shares)) if shares else 0.0


def gone_share(first: SmallFrame, second: SmallFrame) -> float:
    """Return the share of points of the first frame that are gone in the second one, 0 to 1."""
    rows, columns = np.nonzero(_solid(first.depth))
    pixel, depth = pixels_showing(second.camera, first.points_at(rows, columns))
    inside = pixel >= 0
    nearest = _least_around(_known(second.depth)).reshape(-1)[pixel[inside]]
    known = np.isfinite(nearest)
    through = nearest[known] > (1 + limits.SEEN_THROUGH) * depth[inside][known]
    if not through.any():
        return 0.0
    places = (each[inside][known][through] for each in (rows, columns))
    gone = _unlike(first, second)[tuple(places)]
    return np.count_nonzero(gone) / max(len(through), limits.FEWEST_MOVED_POINTS)


def _unlike(first: SmallFrame, second: SmallFrame) -> np.ndarray:
    """Return where the first frame has another brightness than what the second one shows there.

    Bool, (height, width); False where the second frame shows nothing.
    """
    rows, columns = np.nonzero(np.isfinite(second.depth))
    pixel, _ = pixels_showing(first.camera, second.points_at(rows, columns))
    ratio = brightness_ratio(first, second) or 1.0  # the exposure may differ
    shown = pixel >= 0
    brightness = (second.green[rows, columns][shown] / ratio).astype(np.float64)
    darkest, brightest = np.full((2, first.depth.size), [[np.inf], [-np.inf]])
    np.minimum.at(darkest, pixel[shown], brightness)  # fast, as both are float64
    np.maximum.at(brightest, pixel[shown], brightness)
    shape = first.depth.shape
    darkest = _least_around(darkest.reshape(shape))
    brightest = -_least_around(-brightest.reshape(shape))
    darker = first.green < darkest - limits.OTHER_BRIGHTNESS
    brighter = first.green > brightest + limits.OTHER_BRIGHTNESS
    return (darker | brighter) & (brightest >= darkest)


def _solid(depth: np.ndarray) -> np.ndarray:
    """Return where the depth is known and steps nowhere near, (height, width) bool."""
    nearest, farthest = _least_around(_known(depth)), -_least_around(_known(-depth))
    return (
        np.isfinite(nearest)
        & np.isfinite(farthest)
        & (farthest < (1 + limits.DEPTH_STEP) * nearest)
    )


def _known(values: np.ndarray) -> np.ndarray:
    """Return the values with -infinity where unknown, so that the least around there is."""
    return np.where(np.isfinite(values), values, -np.inf)


def _least_around(values: np.ndarray) -> np.ndarray:
    """Return the least value within AROUND pixels, (height, width)."""
    import cv2

    return cv2.erode(values, np.ones((2 * AROUND + 1, 2 * AROUND + 1), np.uint8))
