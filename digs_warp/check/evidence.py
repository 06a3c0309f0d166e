"""What the checks look at: a few pairs of neighboring frames at thumbnail size, and how well these agree.

Two frames agree where the depth of one is what the camera of the other measured.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np

from digs_warp.check import thresholds as limits
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.viewpoints import spread
from digs_warp.geometry.reproject import FINE, SAME_SURFACE, DepthTolerance, compare_depth
from digs_warp.measure.thumbnails import SmallFrame, pixels_showing, small_frames

_Measured = TypeVar("_Measured")
Pairs = Sequence[tuple[int, int]]

# This many pairs, evenly spread over the recording.
PAIRS = 8

# The second frame of a pair is the next one that the camera has turned this far from [degrees], or moved this
# share of the extent of its path. With less motion, wrong depth and right depth look the same.
TURN, MOVE = 10.0, 0.1

# It is among the next frames; together they are at most this share of the recording.
REACH = 0.25

# If it turned farther than this [degrees], the two frames see little in common: the least turned frame of the
# recording is taken instead, for example one of the orbit above. Angles are right in any pose convention.
TOO_FAR = 25.0

# Points looked at in each frame of a pair.
SAMPLES = 500

# Photographs store about the 2.2th root of the light.
GAMMA = 2.2


@dataclass(frozen=True)
class Agreement:
    """What the pairs of a capture say.

    Attributes:
        overlap: share of the points of one frame that the other one looks at and has depth for, 0 to 1.
        depth: share of points at the depth that the other frame measured, among those that it does not hide;
            mean of the shares within a fine and the usual tolerance.
        brightness: correlation of the brightness that both frames give those points, -1 to 1.
    """

    overlap: float
    depth: float
    brightness: float

    @property
    def is_known(self) -> bool:
        """Whether the frames show enough, and have enough in common, to tell."""
        return self.overlap > 0

    @property
    def score(self) -> float:
        """Depth and brightness together, 0 to 1."""
        return self.depth * max(self.brightness, 0.0)


@dataclass(frozen=True, eq=False)
class Evidence:
    """A capture as the checks see it; what several of them need is measured once.

    Attributes:
        capture: the recording.
        uses_poses: whether its poses matter.
        uses_masks: whether its masks matter.
    """

    capture: Capture
    uses_poses: bool = True
    uses_masks: bool = True
    _measured: dict[Any, Any] = field(default_factory=dict)

    def once(self, measure: "Callable[[Evidence], _Measured]") -> _Measured:
        """Return what a measure says of this capture; it is asked once."""
        if measure not in self._measured:
            self._measured[measure] = measure(self)
        return self._measured[measure]

    @property
    def knows_poses(self) -> bool:
        """Whether there are poses, and they matter."""
        return self.uses_poses and self.capture.knows_poses

    @cached_property
    def frames(self) -> dict[int, SmallFrame]:
        """Thumbnails of the frames of some pairs by their number; none where no depth is known."""
        pairs = neighbors(self.capture.frames)
        numbers = sorted({number for pair in pairs for number in pair}) or [0]
        whole = [replace(frame, alone=False) for frame in self.capture.frames]
        frames = small_frames(whole, numbers)
        return frames if any(np.isfinite(f.depth).any() for f in frames.values()) else {}

    @cached_property
    def compared(self) -> dict[int, SmallFrame]:
        """The same; of an object alone, with no other depth."""
        if not self.capture.frames[0].alone:
            return self.frames
        return {number: frame.alone for number, frame in self.frames.items()}

    @cached_property
    def pairs(self) -> list[tuple[int, int]]:
        """Pairs of them; none without poses."""
        pairs = neighbors(self.capture.frames) if self.knows_poses else []
        return [pair for pair in pairs if set(pair) <= self.frames.keys()]

    @cached_property
    def agreement(self) -> Agreement | None:
        """How well the pairs agree; None without poses or depth."""
        return agreement(self.compared, self.pairs) if self.pairs else None


def neighbors(frames: Sequence[Frame]) -> list[tuple[int, int]]:
    """Return pairs of numbers of neighboring frames, evenly spread, with some motion between them."""
    if len(frames) < 2:
        return []
    poses = np.stack([frame.camera.world_from_cam for frame in frames])
    extent = float(np.linalg.norm(np.ptp(poses[:, :3, 3], axis=0)))
    reach = max(1, int(REACH * len(frames)))
    pairs = [(i, _partner(poses, i, MOVE * extent, reach)) for i in spread(len(frames) - 1, PAIRS)]
    return sorted({(min(pair), max(pair)) for pair in pairs})


def _partner(poses: np.ndarray, first: int, far: float, reach: int) -> int:
    """Return the number of the frame that is compared with the frame ``first``."""
    moved = np.linalg.norm(poses[:, :3, 3] - poses[first, :3, 3], axis=1)
    cosines = (np.einsum("ij,nij->n", poses[first, :3, :3], poses[:, :3, :3]) - 1) / 2
    turned = np.rad2deg(np.arccos(np.clip(cosines, -1, 1)))
    ahead = slice(first + 1, first + 1 + reach)
    enough = (turned[ahead] > TURN) | (moved[ahead] > far)
    following = first + 1 + int(np.argmax(enough)) if enough.any() else len(enough) + first
    if turned[following] <= TOO_FAR:
        return following
    turned[turned < TURN] = np.inf
    return int(np.argmin(turned))


class SharedPoints(NamedTuple):
    """What one frame says about points of another, (n,) each.

    Attributes:
        depth: planar depth of the points in its camera [m].
        measured: what it measured at their pixels [m].
        here: brightness in the frame that measured the points.
        there: brightness in the one that is asked.
        marked_here: whether they are in the mask of the frame that measured them; true without masks.
        marked_there: the same of the other one.
        looked_at: number of points of the first frame; others of them lie outside or have no depth there.
    """

    depth: np.ndarray
    measured: np.ndarray
    here: np.ndarray
    there: np.ndarray
    marked_here: np.ndarray
    marked_there: np.ndarray
    looked_at: int

    @property
    def same_surface(self) -> np.ndarray:
        """Which points both frames measure at about the same place, bool."""
        return compare_depth(self.depth, self.measured).agrees


def shared_points(first: SmallFrame, second: SmallFrame) -> SharedPoints:
    """Return what the second frame says about points of the first."""
    measured = np.flatnonzero(np.isfinite(first.depth))
    some = measured[:: max(1, len(measured) // SAMPLES)]
    rows, columns = np.divmod(some, first.depth.shape[1])
    pixel, depth = pixels_showing(second.camera, first.points_at(rows, columns))
    there = np.where(pixel >= 0, second.depth.reshape(-1)[pixel], np.nan)
    known = np.isfinite(there)
    pixel = pixel[known]
    green, marked = (
        (each[rows, columns][known], other.reshape(-1)[pixel])
        for each, other in ((first.green, second.green), (first.shown, second.shown))
    )
    return SharedPoints(depth[known], there[known], *green, *marked, len(some))


def agreement(frames: Mapping[int, SmallFrame], pairs: Pairs) -> Agreement:
    """Return how well the pairs agree, each looked at from both sides; zeros if too little is in common."""
    seen = [shared_points(frames[a], frames[b]) for pair in pairs for a, b in (pair, pair[::-1])]
    here = np.concatenate([each.here for each in seen])
    if len(here) < limits.LEAST_POINTS_IN_COMMON or here.std() < limits.PLAIN_IMAGE:
        return Agreement(0.0, 0.0, 0.0)
    there = np.concatenate([_as_exposed_here(each) for each in seen])
    close = np.concatenate([each.same_surface for each in seen])
    overlap = len(here) / max(sum(each.looked_at for each in seen), 1)
    return Agreement(overlap, same_depth_share(seen), _correlation(here[close], there[close]))


def same_depth_share(seen: Sequence[SharedPoints]) -> float:
    """Return the share of points that agree, of those not hidden: mean of a fine and the usual tolerance."""
    depth, measured = (np.concatenate([each[i] for each in seen]) for i in range(2))

    def share(tolerance: DepthTolerance) -> float:
        found = compare_depth(depth, measured, tolerance)
        agree = np.count_nonzero(found.agrees)
        return float(agree) / max(agree + np.count_nonzero(found.seen_through), 1)

    return (share(FINE) + share(SAME_SURFACE)) / 2


def _as_exposed_here(seen: SharedPoints) -> np.ndarray:
    """Return the brightness in the second frame as if it had the exposure of the first."""
    close = seen.same_surface
    if close.sum() < limits.LEAST_POINTS_FOR_BRIGHTNESS:
        return seen.there
    return seen.there * (
        np.median(seen.here[close]) / max(float(np.median(seen.there[close])), 1.0)
    )


def _correlation(here: np.ndarray, there: np.ndarray) -> float:
    if len(here) < limits.LEAST_POINTS_FOR_BRIGHTNESS or here.std() == 0 or there.std() == 0:
        return 0.0
    return float(np.corrcoef(here, there)[0, 1])


def brightness_ratio(first: SmallFrame, second: SmallFrame) -> float | None:
    """Return how many times brighter the second frame shows the points that both see; None: too few."""
    seen = shared_points(first, second)
    return ratio_of(seen.here[seen.same_surface], seen.there[seen.same_surface])


def ratio_of(here: np.ndarray, there: np.ndarray) -> float | None:
    """Return how many times brighter places are there, (n,) of 0 to 255 each; None: too few are fair."""
    fair = np.minimum(here, there) > limits.DARKEST
    fair &= np.maximum(here, there) < limits.BRIGHTEST
    if fair.sum() < limits.LEAST_POINTS_FOR_BRIGHTNESS:
        return None
    return float(np.median(there[fair] / here[fair]))


def exposure_change(ratios: Iterable[float | None]) -> float | None:
    """Return the median change of the exposure [stops] of ratios of brightness; None: none is known."""
    stops = [abs(np.log2(ratio)) for ratio in ratios if ratio is not None]
    return float(GAMMA * np.median(stops)) if stops else None
