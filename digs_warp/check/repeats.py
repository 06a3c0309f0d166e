"""Frames that repeat the one before: a camera at rest, or a film that was copied frame by frame."""

import numpy as np

from digs_warp.check.finding import Finding
from digs_warp.check.thumbnails import green_means, thumbnails
from digs_warp.data.capture import Capture
from digs_warp.words import counted

# Longer recordings are thinned evenly, in runs of two frames.
MOST_FRAMES = 300

# Columns of the thumbnails that are compared.
WIDTH = 40

# Images that differ by less than this (mean, of 255) show the same: noise is averaged away in thumbnails.
SAME = 1.0

# A few frames at rest do no harm.
SHARE = 0.2


def repeats(capture: Capture) -> list[Finding]:
    """Return a finding if many frames repeat the one before.

    Raises:
        DigsError: a file that cannot be read.
    """
    last = len(capture) - 1
    if last < 1:
        return []
    starts = np.unique(np.linspace(0, last - 1, min(MOST_FRAMES, last)).round().astype(int))
    numbers = sorted({*starts.tolist(), *(starts + 1).tolist()})
    looked_at = [capture.frames[i] for i in numbers]
    looks = dict(zip(numbers, thumbnails(looked_at, _thumbnail), strict=True))
    same = [_is_same(looks[i], looks[i + 1]) for i in starts.tolist()]
    if np.mean(same) <= SHARE:
        return []
    what = (
        f"{counted(sum(same), 'frame')} of {len(numbers)} repeat the one before: the camera was at rest, or "
        "frames are there twice."
    )
    mend = (
        "They add no view, and where they are held out the scores are too good. Record again with the camera "
        "moving, or take fewer frames: convert --frames."
    )
    return [Finding("repeats", what, mend)]


def _thumbnail(image: np.ndarray) -> np.ndarray:
    return green_means(image, max(1, image.shape[1] // WIDTH))


def _is_same(first: np.ndarray, second: np.ndarray) -> bool:
    return first.shape == second.shape and float(np.abs(first - second).mean()) < SAME
