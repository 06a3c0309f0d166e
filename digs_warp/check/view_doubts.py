"""Findings about the number of views, and the sides of the object that nobody looked at."""

from digs_warp.check.coverage import widest_gap
from digs_warp.check.finding import Finding
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.words import counted

# Fewer frames are few. The smallest good recordings have 12; 3 cannot be enough.
FEWEST = 6

# The widest angle around the object without a camera [degrees]. Walks around an object reach 40; a walk that
# left out half of its circle has 180.
WIDEST = 120.0


def few_views(capture: Capture) -> list[Finding]:
    """Return a finding if the recording has too few frames."""
    if len(capture) >= FEWEST:
        return []
    what = f"The recording has only {counted(len(capture), 'frame')}: most of it is seen once."
    return [Finding("few views", what, "Record 30 to 60 frames, from all sides and two heights.")]


def gap_in_views(capture: Capture) -> list[Finding]:
    """Return a finding if the cameras leave out a side of the object; nothing without poses or masks."""
    if not capture.knows_poses or not any(frame.has(Layer.MASK) for frame in capture.frames):
        return []
    gap = widest_gap([frame.camera for frame in capture.frames])
    if gap is None or gap <= WIDEST:
        return []
    what = (
        f"No camera looks at the object within {gap:.0f} degrees of the circle around it: that side is "
        "not seen."
    )
    return [Finding("gap", what, "Record the missing side, or do not show the result from there.")]
