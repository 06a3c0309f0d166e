"""What is left of a recording without frames that could not be placed, and what of it measures the result."""

import logging
from collections.abc import Collection
from dataclasses import replace

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.poses.tracking import some_of
from digs_warp.words import counted

logger = logging.getLogger(__name__)


def only_registered(
    frames: PosedFrames, names: Collection[str], capture: Capture, test_every: int
) -> PosedFrames:
    """Return the frames that structure from motion has placed, ``names``; warn about the others."""
    lost = [frame.name for frame, _ in frames.by_time if frame.name not in names]
    if not lost:
        return frames
    logger.warning("not registered and left out: %s (%s)", counted(len(lost), "frame"), lost[:5])
    training, held_out = (
        tuple(frame for frame in group if frame.name in names)
        for group in (frames.training, frames.held_out)
    )
    left = replace(frames, training=training, held_out=held_out)
    return with_held_out(left, capture, test_every)


def with_held_out(frames: PosedFrames, capture: Capture, test_every: int) -> PosedFrames:
    """Return the frames, split again if all that were held out, or all others, have been left out.

    What is left is split as a recording of these frames alone would be. That depends on nothing else, so a
    resumed run makes the same choice. A recording that holds out nothing stays without.

    Args:
        frames: what is left.
        capture: the recording. Frames that are now held out take its masks: the evaluation must not use ours.
        test_every: every n-th frame is held out.
    """
    left = tuple(frame for frame, _ in frames.by_time)
    wanted = capture.split(test_every)[1]
    if (frames.training and frames.held_out) or not wanted or len(left) < 2:
        return frames
    again = PosedFrames.split(replace(capture, frames=left, held_out=None), test_every)
    chosen = [frame.name for frame in again.held_out]
    logger.warning(
        "left-out frames left no others to train on or to measure the result; now held out: %s",
        some_of(chosen),
    )
    recorded = {frame.name: frame for frame in capture.frames}
    aside = tuple(_with_its_mask(frame, recorded[frame.name]) for frame in again.held_out)
    return replace(frames, training=again.training, held_out=aside)


def _with_its_mask(frame: Frame, recorded: Frame) -> Frame:
    """Return the frame with the recording's mask; that of one of several objects is no other."""
    ours = frame.has(Layer.MASK) and frame.instance is None
    if not ours or not recorded.has(Layer.MASK):
        return frame
    return frame.with_layer(Layer.MASK, recorded.layers[Layer.MASK])
