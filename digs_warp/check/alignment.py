"""Depth that does not lie over the images, and masks that are empty or inverted."""

from dataclasses import replace
from typing import Any

import numpy as np

from digs_warp.check import thresholds as limits
from digs_warp.check.evidence import Evidence
from digs_warp.check.registration import LOOKED_AT, registration
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import evenly
from digs_warp.measure.thumbnails import SmallFrame, small_frames

# The depth of a Kinect or its like is so much larger than its color image shows it, unless it is registered.
KINECT_SCALE, KINECT_SPREAD = 525 / 585, 0.03
KINECT = (
    " Such is the depth of a Kinect, Xtion or PrimeSense that was recorded without registration: "
    "--register-depth kinect."
)

# Masks that are looked at, evenly spread, for whether they mark anything.
MASKS = 10


def depth_elsewhere(evidence: Evidence, least: float) -> dict[str, Any] | None:
    """Find depth that fits the images better after a shift by this [of the width], or at another size."""
    whole = [replace(frame, alone=False) for frame in evidence.capture.frames]
    frames = small_frames(whole, evenly(range(len(whole)), LOOKED_AT)).values()
    found = registration((frame.green, frame.depth) for frame in frames)
    if found is None or found.certainty < limits.REGISTRATION_CERTAINTY:
        return None
    size = abs(np.log(found.scale))
    if np.hypot(found.right, found.down) < least and size < limits.REGISTRATION_SIZE:
        return None
    return {
        "move": found,
        "kinect": KINECT if abs(found.scale - KINECT_SCALE) < KINECT_SPREAD else "",
    }


def masks_of_nothing(evidence: Evidence, least: float) -> dict[str, Any] | None:
    """Find masks that mark less than this share of the image, or almost no pixel (median)."""
    frames = [frame for frame in evidence.capture.frames if frame.has(Layer.MASK)]
    if not (frames and evidence.uses_masks):
        return None
    some = frames[:: -(-len(frames) // MASKS)]
    marked = [np.count_nonzero(frame.load_mask() > 127) for frame in some]
    size = some[0].camera.intrinsics.width * some[0].camera.intrinsics.height
    pixels = float(np.median(marked))
    is_little = pixels < min(limits.LEAST_MASK, least * size)
    return {"pixels": f"{pixels:,.0f} of {size:,}"} if is_little else None


def masks_inverted(evidence: Evidence, share: float) -> dict[str, Any] | None:
    """Find masks that mark the surroundings: more than this share of them."""
    frames = [frame for frame in evidence.frames.values() if frame.mask is not None]
    inverted = sum(map(_is_inverted, frames)) if evidence.uses_masks else 0
    return {"inverted": inverted, "count": len(frames)} if inverted > share * len(frames) else None


def _is_inverted(frame: SmallFrame) -> bool:
    mask = frame.mask
    assert mask is not None
    border = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
    marked, left_out = (frame.depth[where & np.isfinite(frame.depth)] for where in (mask, ~mask))
    covers = border.mean() >= limits.INVERTED_BORDER and (~mask).mean() >= limits.INVERTED_HOLE
    if not (covers and marked.size and left_out.size):
        return False
    return bool(np.median(left_out) < np.median(marked))
