"""Masks made for the frames of a capture, and where they are stored in the folder of a reconstruction."""

from dataclasses import replace
from pathlib import Path

from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.masks.config import SegmentConfig
from digs_warp.masks.masks import segment, with_masks

MASKS = "masks"
HELD_OUT = "held_out"
MENDED = "mended"


def masked(frames: PosedFrames, config: SegmentConfig, folder: Path) -> PosedFrames:
    """Make masks for the frames. Held-out frames keep theirs: the evaluation must not use our own masks.

    The masks of one of several objects are those of the recording; the frames know that others may hide it.
    """
    training = with_masks(frames.training, segment(frames.training, config, folder))
    held_out = list(frames.held_out)
    if config.source == "instance" or any(not frame.has(Layer.MASK) for frame in held_out):
        held_out = with_masks(held_out, segment(held_out, config, folder / HELD_OUT))
    if config.instance is not None:
        training, held_out = (
            [replace(frame, instance=config.instance) for frame in group]
            for group in (training, held_out)
        )
    return replace(frames, training=tuple(training), held_out=tuple(held_out))


def without_masks(frames: PosedFrames) -> PosedFrames:
    """Return the frames for a whole scene, which uses no masks."""
    training, held_out = (
        tuple(frame.without_layer(Layer.MASK) for frame in group)
        for group in (frames.training, frames.held_out)
    )
    return replace(frames, training=training, held_out=held_out)
