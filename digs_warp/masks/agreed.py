"""Mends masks that most other views contradict: empty ones, cut ones, those with a neighboring object."""

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.masks.from_depth import cut_out, cut_size
from digs_warp.masks.votes import MaskVotes, contradicted, mask_votes
from digs_warp.measure.thumbnails import small_depths
from digs_warp.words import counted, first_few

logger = logging.getLogger(__name__)


def agreed_masks(frames: Sequence[Frame], folder: Path) -> tuple[list[Frame], str | None]:
    """Return the frames, those with a contradicted mask with a mended one; and a sentence that names them.

    Args:
        frames: with metric cameras. Nothing changes if one of them lacks mask or depth.
        folder: where mended masks are written as NAME.png.
    """
    needed = (Layer.MASK, Layer.DEPTH)
    if not all(frame.has(layer) for frame in frames for layer in needed):
        return list(frames), None
    votes = mask_votes([*small_depths(frames, range(len(frames))).values()])
    odd = contradicted(votes)
    if not odd:
        return list(frames), None
    mended = list(frames)
    for number in odd:
        path = folder / f"{frames[number].name}.png"
        write_image(path, _mended(frames[number], votes[number]))
        mended[number] = frames[number].with_layer(Layer.MASK, path)
    names = first_few([frames[number].name for number in odd])
    sentence = (
        f"{counted(len(odd), 'mask')} of {len(frames)} contradicted most other views and "
        f"{'was' if len(odd) == 1 else 'were'} mended: {names}."
    )
    logger.warning("masks: %s The setting mask_agreement: off keeps them.", sentence)
    return mended, sentence


def _mended(frame: Frame, votes: MaskVotes) -> np.ndarray:
    """Return the mask that the votes and the colors of the image make, (height, width), uint8."""
    import cv2

    image = frame.load_image()
    is_object, known = (
        cv2.resize(
            each.astype(np.uint8), cut_size(*image.shape[:2]), interpolation=cv2.INTER_NEAREST
        )
        > 0
        for each in (votes.known & votes.is_object, votes.known)
    )
    return cut_out(image, is_object, known)
