"""A look at the photographs themselves, frame by frame: are they sharp, and does the exposure change?

This takes longer than `digs_warp.check.check`, which looks at thumbnails of a few frames.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from digs_warp.check.blur import sharpness
from digs_warp.check.brightness import exposure_change
from digs_warp.check.finding import Finding
from digs_warp.check.small_frames import small_frames
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.device.parallel import default_threads

# This many frames, evenly spread, are looked at; the exposure is compared with that of the next frame.
MOST_FRAMES = 30

# The least median sharpness. Real and simulated recordings have 0.41 or more, the same ones blurred by 3
# pixels (standard deviation) 0.29 or less; 0.25 is as blurred as can be told.
SHARP = 0.35

# The largest median change of the exposure from frame to frame [stops]. Cameras that adapt reach 0.32.
STEADY = 0.6


@dataclass(frozen=True)
class Photographs:
    """What the photographs are like.

    Attributes:
        sharpness: median, as of `digs_warp.check.blur.sharpness`; None: too plain to tell.
        exposure_change: median from frame to frame [stops]; None: needs depth and poses.
    """

    sharpness: float | None
    exposure_change: float | None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is worse than it could be."""
        found = []
        if self.sharpness is not None and self.sharpness < SHARP:
            what = (
                f"The photographs are blurred: their sharpest edges have {self.sharpness:.0%} of the "
                f"steepness that pixels allow, expected {SHARP:.0%}."
            )
            mend = (
                "Move more slowly, add light or shorten the exposure. If the images were enlarged, use "
                "their original size."
            )
            found.append(Finding("blur", what, mend))
        if self.exposure_change is not None and self.exposure_change > STEADY:
            what = f"The exposure changes by {self.exposure_change:.1f} stops from frame to frame (median)."
            mend = (
                "Keep --fit-exposure on, which is the default. Next time, lock exposure and white "
                "balance."
            )
            found.append(Finding("exposure", what, mend))
        return tuple(found)


def look_at_photographs(capture: Capture) -> Photographs:
    """Return what the photographs of a recording are like.

    Raises:
        DigsError: a file that cannot be read.
    """
    last = len(capture) - 1
    numbers = np.unique(np.linspace(0, last, min(MOST_FRAMES, last + 1)).round().astype(int))
    return Photographs(
        _sharpness([capture.frames[number] for number in numbers]),
        _exposure_change(capture, [(n, n + 1) for n in numbers.tolist() if n < last]),
    )


def _sharpness(frames: Sequence[Frame]) -> float | None:
    with ThreadPoolExecutor(default_threads()) as pool:
        found = [*pool.map(lambda frame: sharpness(frame.load_image()), frames)]
    told = [each for each in found if each is not None]
    return float(np.median(told)) if told else None


def _exposure_change(capture: Capture, pairs: Sequence[tuple[int, int]]) -> float | None:
    if not capture.knows_poses:
        return None
    frames = small_frames(capture.frames, sorted({number for pair in pairs for number in pair}))
    return exposure_change(frames, [pair for pair in pairs if set(pair) <= frames.keys()])
