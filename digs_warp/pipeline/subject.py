"""What is reconstructed: the object in the masks, or the whole scene."""

import logging
from typing import Literal

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.init.start import Subject
from digs_warp.masks.config import SegmentConfig

logger = logging.getLogger(__name__)

SubjectChoice = Literal["auto", "object", "scene"]


def subject_of(capture: Capture, choice: SubjectChoice, masks: SegmentConfig) -> Subject:
    """Return what a run reconstructs; 'auto' decides by the masks.

    Raises:
        DigsError: a whole scene, together with --masks or --instance.
    """
    makes_masks = masks.source != "capture"
    if choice == "scene" and makes_masks:
        flag = (
            f"--masks {masks.masks}" if masks.instance is None else f"--instance {masks.instance}"
        )
        raise DigsError(f"--subject scene: no masks are used; leave out {flag}")
    if choice != "auto":
        return choice
    has_masks = any(frame.has(Layer.MASK) for frame in capture.frames)
    return "object" if makes_masks or has_masks else "scene"


def say_subject(capture: Capture, choice: SubjectChoice, subject: Subject) -> None:
    """Log the decision where the user left it open, and the recording has no masks."""
    if choice == "auto" and subject == "scene":
        logger.info(
            "%s: no masks, so everything in view is reconstructed (--subject scene). For one object in "
            "front of a background, add --masks depth",
            capture,
        )
