"""Whether the outlines of the masks lie where the depth steps: masks that are moved, or cut the object."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.check.small_frames import SmallFrame

# Outlines are moved and grown by up to this many thumbnail pixels.
REACH = 8
# Distances are known up to here [thumbnail px]: those of the largest outline, and a little more.
FARTHEST = REACH + 2

# Depth bends where the second difference of the inverse depth is this share of it; more counts no more.
# That of a plane is zero in any view, so the ground around the object does not count.
BEND = 0.05

# Half the width of an outline [thumbnail px].
HALF_WIDTH = 0.75

# Fewer pixels on either side of the outline, or along it, say nothing.
ENOUGH = 20

# Outlines of fewer frames say nothing: a single one may fit something else by chance.
FEWEST_FRAMES = 3

# The least offset that counts [thumbnail px]. Outlines of good masks fit best at up to 1.
LEAST = 3


@dataclass(frozen=True)
class OutlineFit:
    """How the outlines of the masks fit the depth best.

    Attributes:
        right: move of the outlines [thumbnail px], from -REACH to REACH.
        down: the same, downward.
        moved: how many times more the depth bends along the outlines after this move.
        grown: pixels by which the masks are too small, from -REACH to REACH.
        larger: how many times more the depth bends along the outlines of masks that are so much larger.
        image: how many times steeper the images are along the outlines after the move.
    """

    right: int
    down: int
    moved: float
    grown: int
    larger: float
    image: float

    @property
    def offset(self) -> int:
        """The larger of both moves; 0 where it lies at the end of the range, which is no peak."""
        offset = max(abs(self.right), abs(self.down))
        return offset if offset < REACH else 0

    @property
    def cut(self) -> int:
        """Pixels that the masks lack all around; 0 where it lies at the end of the range."""
        return self.grown if 0 < self.grown < REACH else 0


def outline_fit(frames: Sequence[SmallFrame]) -> OutlineFit | None:
    """Return how the outlines fit best; None if too few frames show an outline and depth."""
    seen = [found for frame in frames if (found := _along_outline(frame)) is not None]
    if len(seen) < max(FEWEST_FRAMES, len(frames) / 2):
        return None
    moved, grown, image = (np.mean([each[i] for each in seen], axis=0) for i in range(3))
    row, column = np.unravel_index(int(np.argmax(moved)), moved.shape)
    best = int(np.argmax(grown))
    return OutlineFit(
        right=int(column) - REACH,
        down=int(row) - REACH,
        moved=_ratio(moved[row, column], moved[REACH, REACH]),
        grown=best - REACH,
        larger=_ratio(grown[best], grown[REACH]),
        image=_ratio(image[row, column], image[REACH, REACH]),
    )


def _along_outline(frame: SmallFrame) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return means along the outline of the mask: bend after moves, after growing, steepness after moves."""
    mask = frame.mask
    if mask is None or min(mask.shape) <= 2 * REACH + 2:
        return None
    distance = _distance(mask)
    bend, steepness = _bend(frame.depth), np.hypot(*np.gradient(frame.green))
    inner = np.zeros(mask.shape, dtype=bool)
    inner[REACH:-REACH, REACH:-REACH] = True
    rings = [inner & (np.abs(distance - by) <= HALF_WIDTH) for by in range(-REACH, REACH + 1)]
    rows, columns = np.nonzero(rings[REACH])
    if np.isfinite(bend[rows, columns]).sum() < ENOUGH:
        return None
    moves = range(-REACH, REACH + 1)
    places = [[(rows + down, columns + right) for right in moves] for down in moves]
    return (
        np.array([[_mean(bend[place]) for place in row] for row in places]),
        np.array([_mean(bend[ring]) for ring in rings]),
        np.array([[_mean(steepness[place]) for place in row] for row in places]),
    )


def _distance(mask: np.ndarray) -> np.ndarray:
    """Return the distance to the outline [px], below 0 inside, (height, width).

    It is infinite, or too large, beyond `FARTHEST`.
    """
    return np.where(mask, 0.5 - _distance_to(~mask), _distance_to(mask) - 0.5)


def _distance_to(pixels: np.ndarray) -> np.ndarray:
    """Return the distance to the nearest of some pixels, a bool mask: along the columns, then along the rows.

    In NumPy, because SciPy's transform takes a quarter of a second to import.
    """
    along = np.where(pixels, 0.0, np.inf)
    for step in range(1, FARTHEST + 1):
        along[step:][pixels[:-step] & (along[step:] > step)] = step
        along[:-step][pixels[step:] & (along[:-step] > step)] = step
    squared = along**2
    nearest = squared.copy()
    for step in range(1, FARTHEST + 1):
        np.minimum(nearest[:, step:], squared[:, :-step] + step**2, out=nearest[:, step:])
        np.minimum(nearest[:, :-step], squared[:, step:] + step**2, out=nearest[:, :-step])
    return np.sqrt(nearest)


def _bend(depth: np.ndarray) -> np.ndarray:
    """Return how much the inverse depth bends, 0 to 1, NaN where unknown, (height, width)."""
    inverse = 1.0 / depth
    across, down = np.full_like(depth, np.nan), np.full_like(depth, np.nan)
    across[:, 1:-1] = inverse[:, 2:] - 2 * inverse[:, 1:-1] + inverse[:, :-2]
    down[1:-1] = inverse[2:] - 2 * inverse[1:-1] + inverse[:-2]
    return np.minimum(np.fmax(np.abs(across), np.abs(down)) * depth / BEND, 1.0)


def _mean(values: np.ndarray) -> float:
    """Return the mean of what is known; 0 where that is little."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) >= ENOUGH else 0.0


def _ratio(best: float, now: float) -> float:
    return float(best / now) if now > 0 else (np.inf if best > 0 else 1.0)
