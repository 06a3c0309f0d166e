"""Single frames whose depth contradicts their neighbors, and places where a recording breaks in two.

Depth of neighboring frames is compared at the recorded poses. A frame that none agrees with, between frames
that agree with each other, has a broken pose, or depth of another moment. Where frames agree on either side
but not across, two recordings are in one, or the poses jump: tracking was lost and found again.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.check.agreement import COARSE, FEW, FINE, reproject, share_that_agrees
from digs_warp.check.finding import Finding
from digs_warp.check.small_frames import SmallFrame, small_frames
from digs_warp.data.capture import Capture
from digs_warp.words import counted

# Longer recordings are thinned evenly.
MOST_FRAMES = 300

# Frames up to this far apart are compared.
REACH = 2

# Two frames that look at this much in common can contradict each other.
OVERLAP = 0.1

# They contradict each other below this share of the median agreement of neighbors, and agree above the other.
CONTRADICT, AGREE = 0.5, 0.75

# Where the depth of neighbors agrees less than this (median), single frames cannot be told from noise.
TELLING = 0.4

# This many frames of two parts are compared with each other.
LOOKS = 8

# More names than this make no list.
NAMED = 6


@dataclass(frozen=True)
class Links:
    """How well frames agree with those up to `REACH` after them: shares 0 to 1; None: nothing in common."""

    shares: dict[tuple[int, int], float | None]
    count: int

    @property
    def typical(self) -> float:
        """Median of neighboring frames; 0 if there are none."""
        found = [s for (a, b), s in self.shares.items() if s is not None and b == a + 1]
        return float(np.median(found)) if found else 0.0

    def between(self, first: int, second: int) -> float | None:
        """Return the agreement of two frames."""
        return self.shares.get((min(first, second), max(first, second)))

    def contradict(self, first: int, second: int) -> bool:
        """Whether two frames measure different things at the same places."""
        share = self.between(first, second)
        return share is not None and share < CONTRADICT * self.typical

    def agree(self, first: int, second: int) -> bool:
        """Whether two frames measure the same."""
        share = self.between(first, second)
        return share is not None and share > AGREE * self.typical


def odd_frames(capture: Capture) -> list[Finding]:
    """Return findings that name the frames; nothing without poses or depth.

    Raises:
        DigsError: a file that cannot be read.
    """
    if not capture.knows_poses or len(capture) < 4:
        return []
    last = len(capture) - 1
    numbers = np.unique(np.linspace(0, last, min(MOST_FRAMES, last + 1)).round().astype(int))
    frames = small_frames(capture.frames, numbers.tolist())
    names = [capture.frames[number].name for number in frames]
    links = _links([*frames.values()])
    if links.typical < TELLING:
        return []
    odd = alone(links)
    found = [_odd_finding([names[i] for i in odd], len(names))] if odd else []
    if gaps := [i for i in breaks(links) if not {i, i + 1} & set(odd)]:
        found.append(_break_finding([(names[i], names[i + 1]) for i in gaps]))
    if len(parts := parts_apart([*frames.values()], links)) > 1:
        found.append(_parts_finding([(names[part[0]], names[part[-1]]) for part in parts]))
    return found


def alone(links: Links) -> list[int]:
    """Return the frames that contradict all around them, where those agree with each other."""
    found = []
    for i in range(links.count):
        around = [j for j in range(i - REACH, i + REACH + 1) if j != i and 0 <= j < links.count]
        against = [j for j in around if links.contradict(i, j)]
        with_it = [j for j in around if links.agree(i, j)]
        together = any(links.agree(a, b) for a in against for b in against if a < b)
        if len(against) >= 2 and not with_it and together:
            found.append(i)
    return found


def breaks(links: Links) -> list[int]:
    """Return the frames after which nothing agrees with what was before, while each side agrees in itself."""
    found = []
    for i in range(1, links.count - 2):
        across = [(i, i + 1), (i - 1, i + 1), (i, i + 2)]
        sides = links.agree(i - 1, i) and links.agree(i + 1, i + 2)
        against = sum(links.contradict(*pair) for pair in across)
        if sides and against >= 2 and not any(links.agree(*pair) for pair in across):
            found.append(i)
    return found


def parts_apart(frames: Sequence[SmallFrame], links: Links) -> list[list[int]]:
    """Return the numbers of the frames in parts of the recording that see nothing in common.

    A part ends where no frame has anything in common with the next `REACH` ones. Parts are joined where any
    of a few frames of both have.
    """
    parts: list[list[int]] = [[0]]
    for i in range(1, links.count):
        before = [links.between(i - 1 - k, i + j) for k in range(REACH) for j in range(REACH - k)]
        if all(share is None for share in before):
            parts.append([])
        parts[-1].append(i)
    parts = [part for part in parts if len(part) > REACH]
    joined: list[list[int]] = []
    for part in parts:
        near = [other for other in joined if _meet(frames, part, other)]
        joined = [other for other in joined if other not in near]
        joined.append(sorted(sum(near, part)))
    return joined


def _meet(frames: Sequence[SmallFrame], first: Sequence[int], second: Sequence[int]) -> bool:
    """Whether any of a few frames of two parts have something in common."""
    some = [part[:: -(-len(part) // LOOKS)] for part in (first, second)]
    return any(_share(frames[a], frames[b]) is not None for a in some[0] for b in some[1])


def _links(frames: Sequence[SmallFrame]) -> Links:
    pairs = [
        (a, b) for a in range(len(frames)) for b in range(a + 1, min(a + 1 + REACH, len(frames)))
    ]
    return Links({(a, b): _share(frames[a], frames[b]) for a, b in pairs}, len(frames))


def _share(first: SmallFrame, second: SmallFrame) -> float | None:
    """Return the share of points in common at the same depth in both; None: hardly any in common."""
    looks = [reproject(first, second), reproject(second, first)]
    nearer = np.concatenate([look[0] for look in looks])
    looked_at = sum(look[3] for look in looks)
    if len(nearer) < max(FEW, OVERLAP * looked_at):
        return None
    return (share_that_agrees(nearer, FINE) + share_that_agrees(nearer, COARSE)) / 2


def _odd_finding(names: Sequence[str], count: int) -> Finding:
    listed = ", ".join(names[:NAMED]) + (", ..." if len(names) > NAMED else "")
    what = (
        f"{counted(len(names), 'frame')} of {count} contradict the depth of the frames before and after: "
        f"{listed}."
    )
    mend = "Their poses are broken, or their depth is of another moment: leave these frames out."
    return Finding("odd frames", what, mend)


def _break_finding(places: Sequence[tuple[str, str]]) -> Finding:
    listed = ", ".join(f"{a} and {b}" for a, b in places[:NAMED])
    what = f"The depth before and after does not fit together between frames {listed}."
    mend = (
        "Are these two recordings in one, or was tracking lost there? Reconstruct each part alone, or find "
        "the poses again with --poses rgbd."
    )
    return Finding("break", what, mend)


def _parts_finding(parts: Sequence[tuple[str, str]]) -> Finding:
    listed = "; ".join(f"{first} to {last}" for first, last in parts[:NAMED])
    what = f"The recording has {len(parts)} parts that see nothing in common: frames {listed}."
    mend = (
        "If these are two recordings in one, reconstruct each alone: nothing tells where one is beside the "
        "other. If not, record what lies between."
    )
    return Finding("parts", what, mend)
