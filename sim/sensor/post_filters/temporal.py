"""The temporal filter of librealsense: an average over the frames that the camera took just before.

Written from Intel's description ("Depth Post-Processing for Intel RealSense Depth Camera D400 Series",
Grunnet-Jepsen and Tong, and the documentation of the post-processing filters): the exponential moving
average of `spatial`, from frame to frame. A hole takes the last value of its pixel if that had one in two of
the last four frames (persistency "valid in 2 of the last 4"), so that three earlier frames are all it needs.
"""

from collections.abc import Sequence

import numpy as np

# Defaults of librealsense; its delta of 20 counts 32nds of a pixel.
ALPHA = 0.4
DELTA = 20 / 32

# A hole is filled if its pixel had a value in this many of the last frames.
PERSISTENCY = 2

# Frames before the one that is recorded: with it, the four that persistency looks at. What still earlier
# ones would add has a weight of 0.13.
EARLIER_FRAMES = 3


def smooth_over_time(
    frames: Sequence[tuple[np.ndarray, np.ndarray]], alpha: float = ALPHA, delta: float = DELTA
) -> tuple[np.ndarray, np.ndarray]:
    """Return disparity and confidence of the last frame after the filter, each (height, width), float32.

    The confidence stays; filled holes have that of the last match.

    Args:
        frames: disparity [px], (height, width), float32, NaN where there is none, and confidence; the
            earliest first.
        alpha: weight of the newer frame, 0 to 1; 1 averages nothing.
        delta: larger differences are changes, which the newer frame decides [px].
    """
    average, trust = frames[0]
    seen = (~np.isnan(average)).astype(np.uint8)
    for disparity, confidence in frames[1:]:
        known = ~np.isnan(disparity)
        change = disparity - average
        smooth = np.where(np.abs(change) < delta, average + np.float32(alpha) * change, disparity)
        average = np.where(known, smooth, average)
        trust = np.where(known, confidence, trust)
        seen += known
    lost = np.isnan(frames[-1][0]) & (seen < PERSISTENCY)
    return np.where(lost, np.float32(np.nan), average), np.where(lost, np.float32(0), trust)
