"""Masks that mark the surroundings instead of the object."""

from collections.abc import Sequence

import numpy as np

from digs_warp.plausibility.small_frames import SmallFrame

# A mask that holds this share of the image's border, and leaves out this much of the image, has a hole in it.
BORDER, HOLE = 0.75, 0.01


def mask_doubts(frames: Sequence[SmallFrame]) -> list[str]:
    """Return a doubt if most masks cover the border of the image and leave out what is nearer."""
    odd = [_is_inverted(frame) for frame in frames if frame.mask is not None]
    if 2 * sum(odd) <= len(odd):
        return []
    return [
        f"{sum(odd)} of {len(odd)} masks cover the border of the image and leave out what is nearest: they "
        "seem to be inverted. 255 marks the object, 0 everything else."
    ]


def _is_inverted(frame: SmallFrame) -> bool:
    mask = frame.mask
    if mask is None:
        return False
    border = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
    marked, left_out = (frame.depth[where & np.isfinite(frame.depth)] for where in (mask, ~mask))
    if border.mean() < BORDER or (~mask).mean() < HOLE or not (marked.size and left_out.size):
        return False
    return bool(np.median(left_out) < np.median(marked))
