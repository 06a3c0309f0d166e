"""The dots of a projector: pseudo-random, and never closer to each other than a pattern of its kind has them.

Places are on the plane one metre in front of the projector: x / z and y / z, so that a dot has the same size
in the image at any distance. Figures "measured" come from a real pair, see docs/sensor.md.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

# Angles that the pattern fills, across and down [deg]. Vendor: D435's projector, 86 +- 3 and 57 +- 3
# (manual of the FRAMOS D435e, 3.3).
FIELD_DEG = (86.0, 57.0)

# Dots per unit of the plane [measured]: 3,990 in the field. Intel says about 5,000 ("Projectors for D400
# Series Depth Cameras", 1).
DENSITY = 1970.0

# Least distance of two dots, as a share of the mean spacing [measured].
LEAST_DISTANCE = 0.76

# Standard deviation of the spot on the plane, blur of the lens included [measured]: with it, spots in 8-bit
# images are as wide as real ones, 1.07 px of 427.
SPOT = 0.002

# Standard deviation of the logarithm of the dots' brightness [measured].
BRIGHTNESS_SPREAD = 0.3

# Every unit has the same pattern: errors must not depend on the seed of a recording.
SEED = 435

# Candidates per round of `_scattered`.
ROUND = 4000


@dataclass(frozen=True, eq=False)
class DotPattern:
    """Dots sorted into square cells, at most one in each.

    Attributes:
        dots: x, y on the plane and brightness (1: mean), (rows, columns, 3), float32; brightness 0: no dot.
        left, top: corner of the first cell on the plane.
        cell: side of a cell; the spots of farther cells than the next do not reach.
    """

    dots: np.ndarray
    left: float
    top: float
    cell: float


@cache
def dot_pattern() -> DotPattern:
    """Return the pattern, the same each time."""
    half = np.tan(np.deg2rad(FIELD_DEG) / 2)
    count = round(DENSITY * 4 * half[0] * half[1])
    least = LEAST_DISTANCE / np.sqrt(DENSITY)
    rng = np.random.default_rng(SEED)
    places = _scattered(rng, half, count, least)
    brightness = np.exp(BRIGHTNESS_SPREAD * rng.standard_normal(count))
    cell = least / np.sqrt(2)  # the diagonal is the least distance
    columns, rows = np.ceil(2 * half / cell).astype(int)
    dots = np.zeros((rows, columns, 3), dtype=np.float32)
    column, row = np.floor((places + half) / cell).astype(int).T
    dots[row, column, :2] = places
    dots[row, column, 2] = brightness / brightness.mean()
    return DotPattern(dots, -float(half[0]), -float(half[1]), float(cell))


def _scattered(rng: np.random.Generator, half: np.ndarray, count: int, least: float) -> np.ndarray:
    """Return random points no closer than ``least``, (count, 2): those that come too near are drawn again."""
    from scipy.spatial import KDTree  # pyright: ignore[reportAttributeAccessIssue]

    points = np.empty((0, 2))
    while len(points) < count:
        new = rng.uniform(-half, half, (ROUND, 2))
        if len(points):
            new = new[KDTree(points).query(new)[0] >= least]
        pairs = KDTree(new).query_pairs(least, output_type="ndarray")
        new = np.delete(new, np.unique(pairs[:, 1]), axis=0)
        points = np.concatenate([points, new])
    return points[:count]
