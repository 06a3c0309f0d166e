"""How far a flat board is from a plane, and how a depth step looks, in depth as a camera reports it."""

from dataclasses import dataclass

import numpy as np

from digs_warp.sim.fit.plane import OF_MAD


def plane_error(depth: np.ndarray, focal: float) -> tuple[float, float]:
    """Return RMS distance of the points from their plane [m], and the plane's depth on the optical axis [m].

    Args:
        depth: planar z of a flat thing in the middle of the image [m], (height, width), NaN where unknown.
        focal: length [px].
    """
    height, width = depth.shape
    rows, columns = np.nonzero(np.isfinite(depth))
    z = depth[rows, columns].astype(np.float64)
    rays = np.stack([columns + 0.5 - width / 2, rows + 0.5 - height / 2, np.full(len(z), focal)], 1)
    points = rays * (z / focal)[:, None]
    center = points.mean(axis=0)
    normal = np.linalg.svd((points - center).T @ (points - center))[2][2]
    off = (points - center) @ normal
    return float(np.sqrt(np.mean(off**2))), float(normal @ center / normal[2])


# Places beside an edge are counted in strips of this width [px].
STRIP = 2.0

# Each side is measured in a band so far beyond the counted places, and so wide [px].
BESIDE, BAND = 5.0, 30.0

# Values of a side are within these of its median: a length [m], or standard deviations if that is more.
ALLOWED, DEVIATIONS = 0.01, 3.0

# The width of an edge goes from where so many of the pixels show the near side to where the rest do.
MANY = 0.9


@dataclass(frozen=True)
class Edge:
    """What a camera makes of a straight vertical depth step.

    Attributes:
        width: from 90 to 10 % of the pixels on the near side [px]; about 3 for a perfect step, as pixels are
            counted in strips of two; NaN: there are no such places.
        mixed: share of the values beside the edge that lie between the sides.
        missing: share of the pixels without a value.
    """

    width: float
    mixed: float
    missing: float


def edge(depth: np.ndarray, distance: np.ndarray, reach: float) -> Edge:
    """Return the figures of an edge, as github.com/ychen921/rgbd-characterization computes them.

    Args:
        depth: [m], (height, width), NaN where there is none.
        distance: of each pixel from the true edge [px], positive on the far side; same shape.
        reach: up to so far from the edge pixels count [px].
    """
    near, far = (_side(depth, side * distance - reach - BESIDE) for side in (-1, 1))
    band = np.abs(distance) <= reach
    value, place = depth[band], distance[band]
    known = np.isfinite(value)
    between = (value > near[1]) & (value < far[0])
    strip = np.floor(place / STRIP + 0.5).astype(int)
    strip -= strip.min()
    seen = np.bincount(strip[known], minlength=strip.max() + 1)
    on_near = (value >= near[0]) & (value <= near[1])
    shown = np.bincount(strip[on_near], minlength=len(seen)) / np.maximum(seen, 1)
    centers = (np.arange(len(seen)) - len(seen) // 2) * STRIP
    ends = [_crossing(centers[seen > 0], shown[seen > 0], level) for level in (MANY, 1 - MANY)]
    return Edge(
        width=ends[1] - ends[0],
        mixed=float(between.sum() / max(known.sum(), 1)),
        missing=float(1 - known.mean()),
    )


def _side(depth: np.ndarray, beyond: np.ndarray) -> tuple[float, float]:
    """Return the least and the largest depth that count as one side [m]."""
    values = depth[(beyond > 0) & (beyond < BAND) & np.isfinite(depth)]
    middle = np.median(values)
    allowed = max(ALLOWED, DEVIATIONS * OF_MAD * float(np.median(np.abs(values - middle))))
    return float(middle - allowed), float(middle + allowed)


def _crossing(places: np.ndarray, shares: np.ndarray, level: float) -> float:
    """Return where falling shares pass a level, NaN where they do not."""
    above = np.flatnonzero(shares >= level)
    if len(above) == 0 or above[-1] == len(shares) - 1:
        return np.nan
    at = above[-1]
    part = (shares[at] - level) / (shares[at] - shares[at + 1])
    return float(places[at] + part * (places[at + 1] - places[at]))
