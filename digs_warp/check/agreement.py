"""How well neighboring frames agree: the depth of one, seen by the camera of the other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.check.small_frames import SmallFrame, pixels_showing

# Points looked at in each frame of a pair.
SAMPLES = 500

# Relative differences of depth that count as agreement; a fine and a coarse one, for good and noisy sensors.
FINE, COARSE = 0.02, 0.05

# Fewer points that agree say nothing about their brightness.
ENOUGH = 50

# Frames with fewer points in common say nothing at all.
FEW = 200

# Images that vary by less (standard deviation, of 255) show nothing, and depth alone misleads: around an
# object, inverted poses bring it into agreement, too.
DULL = 2.0


@dataclass(frozen=True)
class Agreement:
    """What the pairs of a capture say.

    Attributes:
        overlap: share of the points of one frame that the other one looks at and has depth for, 0 to 1.
        depth: share of points at the depth that the other frame measured, among those that it does not hide;
            mean of the shares within FINE and COARSE.
        brightness: correlation of the brightness that both frames give those points, -1 to 1.
    """

    overlap: float
    depth: float
    brightness: float

    @property
    def score(self) -> float:
        """Depth and brightness together, 0 to 1."""
        return self.depth * max(self.brightness, 0.0)


def agreement(frames: Mapping[int, SmallFrame], pairs: Sequence[tuple[int, int]]) -> Agreement:
    """Return how well the pairs agree, each looked at from both sides; zeros if too little is in common."""
    seen = [
        reproject(frames[first], frames[second])
        for pair in pairs
        for first, second in (pair, pair[::-1])
    ]
    nearer, here = (np.concatenate([part[i] for part in seen]) for i in range(2))
    there = np.concatenate([_as_exposed_here(*part[:3]) for part in seen])
    looked_at = sum(part[3] for part in seen)
    if len(nearer) < FEW or here.std() < DULL:
        return Agreement(0.0, 0.0, 0.0)
    close = np.abs(nearer) < COARSE
    brightness = _correlation(here[close], there[close])
    depth = (share_that_agrees(nearer, FINE) + share_that_agrees(nearer, COARSE)) / 2
    return Agreement(len(nearer) / max(looked_at, 1), depth, brightness)


def reproject(
    first: SmallFrame, second: SmallFrame
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Return what the second frame says about points of the first.

    Returns:
        The log of depth in the second camera over measured depth, below 0 where the second frame sees through
        the point; the brightness in either frame, all of shape (n,); and the number of points looked at.
    """
    measured = np.flatnonzero(np.isfinite(first.depth))
    some = measured[:: max(1, len(measured) // SAMPLES)]
    rows, columns = np.divmod(some, first.depth.shape[1])
    pixel, depth = pixels_showing(second.camera, first.points_at(rows, columns))
    inside = pixel >= 0
    nearer = np.log(depth[inside] / second.depth.reshape(-1)[pixel[inside]])
    known = np.isfinite(nearer)
    here = first.green[rows, columns][inside]
    return nearer[known], here[known], second.green.reshape(-1)[pixel[inside]][known], len(pixel)


def _as_exposed_here(nearer: np.ndarray, here: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return the brightness in the second frame as if it had the exposure of the first."""
    close = np.abs(nearer) < COARSE
    if close.sum() < ENOUGH:
        return there
    return there * (np.median(here[close]) / max(float(np.median(there[close])), 1.0))


def share_that_agrees(nearer: np.ndarray, tolerance: float) -> float:
    """Return the share of points that agree, among those that agree or are seen through."""
    agree = np.count_nonzero(np.abs(nearer) < tolerance)
    return float(agree) / max(agree + np.count_nonzero(nearer <= -tolerance), 1)


def _correlation(here: np.ndarray, there: np.ndarray) -> float:
    if len(here) < ENOUGH or here.std() == 0 or there.std() == 0:
        return 0.0
    return float(np.corrcoef(here, there)[0, 1])
