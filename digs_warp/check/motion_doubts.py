"""A finding about things that move while they are recorded."""

from collections.abc import Mapping, Sequence

from digs_warp.check.finding import Finding
from digs_warp.check.motion import moved_share
from digs_warp.check.small_frames import SmallFrame

# The share of points that may be gone in the other frame. Good captures reach half of it: a plain boot whose
# simulated depth is often wrong 0.007, real ones less than 0.001.
MOST_MOVED = 0.015


def motion_doubts(
    frames: Mapping[int, SmallFrame], pairs: Sequence[tuple[int, int]]
) -> list[Finding]:
    """Return a finding if many points of a frame are gone in its neighbor."""
    share = moved_share(frames, pairs)
    if share <= MOST_MOVED:
        return []
    what = (
        f"{share:.1%} of the points of a frame are gone in its neighbor, which shows something else behind "
        "them: something moves."
    )
    mend = (
        "Record again while nothing moves, or use --masks so that only the object counts. If nothing moved, "
        "the poses are those of other frames: check their order."
    )
    return [Finding("moving things", what, mend)]
