"""Boxes of pixels: where an image has content, and where a loss has to be computed."""

import numpy as np

Box = tuple[int, int, int, int]
"""Pixels x0 <= x < x1, y0 <= y < y1 as (x0, y0, x1, y1); empty when x0 >= x1 or y0 >= y1."""


def union(a: Box, b: Box) -> Box:
    """Return the smallest box around two boxes; an empty one does not count."""
    if a[0] >= a[2] or a[1] >= a[3]:
        return b
    if b[0] >= b[2] or b[1] >= b[3]:
        return a
    return min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])


def grown(box: Box, margin: int, width: int, height: int) -> Box:
    """Return the box with ``margin`` pixels more on each side, inside an image of the given size."""
    if box[0] >= box[2] or box[1] >= box[3]:
        return 0, 0, 0, 0
    x0, y0 = max(box[0] - margin, 0), max(box[1] - margin, 0)
    return x0, y0, min(box[2] + margin, width), min(box[3] + margin, height)


def mask_box(mask: np.ndarray) -> Box:
    """Return the box of the pixels above 0, (0, 0, 0, 0) when there is none."""
    ys, xs = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(xs):
        return 0, 0, 0, 0
    return int(xs[0]), int(ys[0]), int(xs[-1]) + 1, int(ys[-1]) + 1
