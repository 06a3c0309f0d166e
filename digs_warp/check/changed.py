"""A scene that changed while it was recorded: frames before a moment see through what those after it saw.

Neighbors agree then, on either side, and so no pair of them tells it. So frames that look from about the same
side are compared wherever they are in the recording, and the moment is sought that parts them best.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from digs_warp.check.finding import Finding
from digs_warp.check.motion import gone_share
from digs_warp.check.small_frames import SmallFrame, small_frames
from digs_warp.data.capture import Capture
from digs_warp.data.evenly import evenly
from digs_warp.device.parallel import default_threads

# This many frames, evenly spread, are compared with those that look less than this angle [degrees] away.
FRAMES, ANGLE = 16, 60.0

# The least frames on each side of the moment, and pairs across it and on the same side.
FEWEST_FRAMES, FEWEST_PAIRS = 3, 6

# The share of points that are gone across the moment. Good recordings reach 0.0044: where the second half
# looks from above, at a cow or into a bookshelf, points of the first seem gone.
CHANGED = 0.01

# Across the moment, that many times more points are gone than on the same side of it: glass, gloss and wrong
# depth hide points on both.
TIMES = 5.0


@dataclass(frozen=True)
class Moment:
    """The moment that parts the frames best.

    Attributes:
        after: the number of the first frame after it, among those compared.
        across: share of the points of one side that are gone on the other, 0 to 1: the median over the pairs,
            for wrong depth makes many points of a few pairs seem gone.
        within: the same between frames of one side.
    """

    after: int
    across: float
    within: float

    @property
    def is_change(self) -> bool:
        """Whether the scene changed there."""
        return self.across > CHANGED and self.across > TIMES * self.within


def changed_scene(capture: Capture) -> list[Finding]:
    """Return a finding if the scene before a moment differs from that after it; needs depth and poses.

    Raises:
        DigsError: a file that cannot be read.
    """
    if not capture.knows_poses:
        return []
    numbers = evenly(range(len(capture)), FRAMES)
    frames = small_frames(capture.frames, numbers)
    found = moment_of_change([*frames.values()])
    if found is None or not found.is_change:
        return []
    names = [capture.frames[number].name for number in frames]
    what = (
        f"Up to frame {names[found.after - 1]} the frames show another scene than from frame "
        f"{names[found.after]} on: {found.across:.1%} of the points of one part are gone in the other, "
        f"{found.within:.1%} between frames of the same part."
    )
    mend = (
        "Are these two recordings in one, or was something moved in between? Reconstruct each part alone, or "
        "use --masks so that only what stayed counts."
    )
    return [Finding("change", what, mend)]


def moment_of_change(frames: Sequence[SmallFrame]) -> Moment | None:
    """Return the moment that parts the frames best; None if too few look from the same side."""
    first, second = _pairs(frames)
    with ThreadPoolExecutor(default_threads()) as pool:
        gone = [*pool.map(lambda a, b: _gone(frames[a], frames[b]), first, second)]
    shares = np.array(gone, dtype=np.float64)
    moments = []
    for after in range(FEWEST_FRAMES, len(frames) - FEWEST_FRAMES + 1):
        across = (first < after) != (second < after)
        if min(np.count_nonzero(across), np.count_nonzero(~across)) >= FEWEST_PAIRS:
            here, there = (float(np.median(shares[part])) for part in (across, ~across))
            moments.append(Moment(after, here, there))
    return max(moments, key=lambda moment: moment.across - moment.within, default=None)


def _pairs(frames: Sequence[SmallFrame]) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of frames that look in about the same direction, (n,) each."""
    axes = np.array([frame.camera.world_from_cam[:3, 2] for frame in frames]).reshape(-1, 3)
    same_side = np.einsum("ik,jk->ij", axes, axes) > np.cos(np.deg2rad(ANGLE))
    first, second = np.nonzero(np.triu(same_side, 1))
    return first, second


def _gone(first: SmallFrame, second: SmallFrame) -> float:
    return (gone_share(first, second) + gone_share(second, first)) / 2
