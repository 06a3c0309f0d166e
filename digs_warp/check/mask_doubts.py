"""Masks that mark the surroundings instead of the object, lie beside it, or cut it."""

from collections.abc import Sequence

import numpy as np

from digs_warp.check.alignment_doubts import moved_by, not_aligned
from digs_warp.check.finding import Finding
from digs_warp.check.mask_outline import LEAST, OutlineFit, outline_fit
from digs_warp.check.small_frames import SmallFrame

# A mask that holds this share of the image's border, and leaves out this much of the image, has a hole in it.
BORDER, HOLE = 0.75, 0.01

# After a move or growth of the outlines that counts, the depth bends along them this many times more.
BETTER_MOVED, BETTER_GROWN = 1.25, 1.5


def mask_doubts(frames: Sequence[SmallFrame]) -> list[Finding]:
    """Return what is wrong with most masks: the first of inverted, moved, too small.

    Where outlines of masks fit the images but not the depth, the depth is what was moved.
    """
    odd = [_is_inverted(frame) for frame in frames if frame.mask is not None]
    if 2 * sum(odd) > len(odd):
        what = (
            f"{sum(odd)} of {len(odd)} masks cover the border of the image and leave out what is nearest: "
            "they seem to be inverted."
        )
        return [Finding("masks inverted", what, "255 marks the object, 0 everything else.")]
    fit = outline_fit(frames)
    return [] if fit is None else _doubts_about_outlines(fit, frames[0])


def _doubts_about_outlines(fit: OutlineFit, frame: SmallFrame) -> list[Finding]:
    is_cut = fit.cut >= LEAST and fit.larger > BETTER_GROWN
    if is_cut and (fit.larger >= fit.moved or not fit.offset):
        what = (
            f"The depth ends {fit.cut / frame.depth.shape[1]:.1%} of the image's width outside of the masks: "
            "they cut the object."
        )
        mend = "Make them again: --masks depth, or a folder of better ones with --masks folder."
        return [Finding("masks cut", what, mend)]
    if fit.offset < LEAST or fit.moved <= BETTER_MOVED:
        return []
    if fit.image < 1:
        return [not_aligned(-fit.right, -fit.down, frame)]
    move = moved_by(fit.right, fit.down, frame)
    what = f"The masks fit depth and images better if they are moved by {move}."
    mend = "Make them from the images of this recording, at their full size and without cropping."
    return [Finding("masks moved", what, mend)]


def _is_inverted(frame: SmallFrame) -> bool:
    mask = frame.mask
    if mask is None:
        return False
    border = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
    marked, left_out = (frame.depth[where & np.isfinite(frame.depth)] for where in (mask, ~mask))
    if border.mean() < BORDER or (~mask).mean() < HOLE or not (marked.size and left_out.size):
        return False
    return bool(np.median(left_out) < np.median(marked))
