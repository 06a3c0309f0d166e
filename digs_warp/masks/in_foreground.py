"""A network's mask where the depth has a foreground: each makes up for what the other one gets wrong.

A network often takes what the object stands on, or nothing. The foreground of the depth says where to look,
and what is surely not the object; the network knows the border.
"""

from collections.abc import Callable

import numpy as np

from digs_warp.masks.from_depth import OBJECT, mask_from_depth

# The network sees the foreground with this much around it, as a share of its larger side.
AROUND = 0.15

# It may add pixels up to this far from the foreground, as a share of the image's longer side: the depth of
# borders is missing or wrong.
BORDER = 0.015

# A network that finds less than this share of the foreground has not found the object.
LEAST_FOUND = 0.5


def mask_in_foreground(
    network: Callable[[np.ndarray], np.ndarray], image: np.ndarray, depth: np.ndarray
) -> np.ndarray:
    """Return the network's mask inside the depth's foreground, (height, width), uint8.

    Where the network finds nothing there, the foreground itself; where the depth has none, an empty mask.

    Args:
        network: from an sRGB image (height, width, 3) uint8 to its mask, (height, width) uint8.
        image: sRGB, shape (height, width, 3), uint8.
        depth: planar depth [m], shape (height, width), NaN where unknown.
    """
    import cv2

    foreground = mask_from_depth(image, depth)
    inside = foreground > OBJECT // 2
    if not inside.any():
        return foreground
    part = _box(inside)
    found = np.zeros_like(foreground)
    found[part] = network(np.ascontiguousarray(image[part]))
    reach = round(BORDER * max(inside.shape))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    found[cv2.dilate(inside.astype(np.uint8), kernel) == 0] = 0
    share = np.count_nonzero(inside & (found > OBJECT // 2)) / np.count_nonzero(inside)
    return found if share >= LEAST_FOUND else foreground


def _box(inside: np.ndarray) -> tuple[slice, slice]:
    """Return rows and columns around the pixels, with AROUND more on each side."""
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    more = round(AROUND * max(np.ptp(rows), np.ptp(columns)))
    return (
        slice(max(0, int(rows[0]) - more), int(rows[-1]) + 1 + more),
        slice(max(0, int(columns[0]) - more), int(columns[-1]) + 1 + more),
    )
