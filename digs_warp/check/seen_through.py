"""Where a mask may be right although depth lies behind it: the object is glass, which depth sees through.

What the masks of the other views leave of space tells it (the visual hull; Laurentini, "The visual hull
concept for silhouette-based image understanding", IEEE PAMI 1994): where a pixel's ray passes through that
before it comes to the measured depth, the object may stand there.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.check.small_frames import SmallDepth, pixels_showing

# Places that are looked at along a ray, each farther by the same factor: 3 to 5 % with walls at 6 m.
PLACES = 64
# The first of them, as a share of the least depth in the frame: glass stands before what is measured.
FIRST = 0.5
# The last of them, as a share of the pixel's depth: nearer to it is what was measured.
LAST = 0.95
# A place is in the hull if at least FEWEST_VIEWS views have it in their image, IN_MASKS of them in the mask.
FEWEST_VIEWS, IN_MASKS = 3, 0.8


def seen_through(
    frame: SmallDepth, rows: np.ndarray, columns: np.ndarray, others: Sequence[SmallDepth]
) -> np.ndarray:
    """Return at which pixels the object of the other masks may stand before what was measured, (n,) bool.

    Args:
        frame: with depth at all of the pixels.
        rows: of the pixels, (n,).
        columns: of the pixels, (n,).
        others: with masks.
    """
    depth = frame.depth[rows, columns].astype(np.float64)
    first = FIRST * float(np.nanmin(frame.depth))
    found = np.zeros(len(depth), dtype=bool)
    centers = np.stack([columns + 0.5, rows + 0.5], axis=1)
    for share in np.linspace(0, 1, PLACES):
        place = first ** (1 - share) * np.maximum(first, LAST * depth) ** share
        found |= in_hull(frame.camera.unproject(centers, place), others)
    return found


def in_hull(points: np.ndarray, others: Sequence[SmallDepth]) -> np.ndarray:
    """Return which points most of the views have in their masks, (n,) bool."""
    views, masks = np.zeros((2, len(points)))
    for other in others:
        assert other.mask is not None
        pixel, _ = pixels_showing(other.camera, points)
        inside = pixel >= 0
        views += inside
        masks += inside & other.mask.reshape(-1)[pixel]
    return (views >= FEWEST_VIEWS) & (masks >= IN_MASKS * views)
