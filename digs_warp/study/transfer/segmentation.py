"""Find the object on a table, pixel by pixel, from depth alone.

A pixel is described by how much it stands out of its surround: the mean of two opposite neighbors at a fixed
distance in the world, minus the pixel itself, in four directions (after Shotton et al., "Real-Time Human Pose
Recognition in Parts from Single Depth Images", 2011, eq. 1). In inverse depth such a difference is zero on a
plane, however the camera looks at it; sorted over the directions it does not change when the camera turns
about its axis. Boosted trees tell object from surround.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

# Radii of the rings of neighbors [m], and pairs of opposite neighbors on each.
RINGS = (0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32)
PAIRS = 4

# Larger differences tell no more than that there is a step [m].
FAR = 0.3

# Pixels of each training frame, half of them on the object where it has that many.
PIXELS = 1000


@dataclass(frozen=True, eq=False)
class DepthFrame:
    """A depth image with the answer.

    Attributes:
        depth: planar depth [m], (height, width), float32, NaN where nothing was measured.
        focal: focal length [px].
        is_object: (height, width), bool.
    """

    depth: np.ndarray
    focal: float
    is_object: np.ndarray


def describe(frame: DepthFrame, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the features of some pixels [m], shape (n, RINGS x PAIRS), float32; positive: stands out.

    NaN where a neighbor has no depth or lies outside the image; a pixel without depth has NaN alone.
    """
    with np.errstate(divide="ignore"):
        inverse = 1.0 / frame.depth.astype(np.float64)
    here = inverse[rows, columns]
    angles = np.arange(PAIRS) * (np.pi / PAIRS)
    rings = []
    for radius in RINGS:
        reach = np.nan_to_num(frame.focal * radius * here)[:, None]
        right, down = reach * np.cos(angles), reach * np.sin(angles)
        two = _values(inverse, rows, columns, down, right)
        two = two + _values(inverse, rows, columns, -down, -right)
        out = (here[:, None] - two / 2) / here[:, None] ** 2
        rings.append(np.sort(np.clip(out, -FAR, FAR), axis=1))  # NaN last
    return np.concatenate(rings, axis=1).astype(np.float32)


def _values(
    image: np.ndarray, rows: np.ndarray, columns: np.ndarray, down: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """Return the values beside some pixels, the shape of ``down``; NaN outside the image."""
    height, width = image.shape
    row = np.rint(rows[:, None] + down).astype(np.int64)
    column = np.rint(columns[:, None] + right).astype(np.int64)
    inside = (0 <= row) & (row < height) & (0 <= column) & (column < width)
    found = image[row.clip(0, height - 1), column.clip(0, width - 1)]
    return np.where(inside, found, np.nan)


def train(frames: Sequence[DepthFrame], seed: int = 0) -> Any:
    """Return trees that have learned the frames; the pixels are drawn with ``seed``."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    rng = np.random.default_rng(seed)
    features, answers = [], []
    for frame in frames:
        for answer in (True, False):
            rows, columns = np.nonzero((frame.is_object == answer) & np.isfinite(frame.depth))
            chosen = rng.permutation(len(rows))[: PIXELS // 2]
            features.append(describe(frame, rows[chosen], columns[chosen]))
            answers.append(np.full(len(chosen), answer))
    trees = HistGradientBoostingClassifier(max_iter=60, random_state=seed)
    learned = np.concatenate(features)
    learned[:, np.isnan(learned).all(axis=0)] = (
        0.0  # scikit-learn cannot cut a feature that nobody has
    )
    return trees.fit(learned, np.concatenate(answers))


def find_object(trees: Any, frame: DepthFrame) -> np.ndarray:
    """Return where the trees see the object, (height, width), bool; never without depth."""
    found = np.zeros(frame.depth.shape, dtype=bool)
    rows, columns = np.nonzero(np.isfinite(frame.depth))
    if len(rows):
        found[rows, columns] = trees.predict(describe(frame, rows, columns))
    return found


def overlap(found: np.ndarray, truth: np.ndarray) -> float:
    """Return intersection over union of two masks, 0 to 1; 1 if both are empty."""
    union = np.count_nonzero(found | truth)
    return np.count_nonzero(found & truth) / union if union else 1.0


def above_plane(frame: DepthFrame, height: float = 0.006) -> np.ndarray:
    """Return what lies nearer than the most common plane, without learning: for comparison.

    Args:
        frame: shows a plane; its answer is not used.
        height: above the plane [m].
    """
    rows, columns = np.nonzero(np.isfinite(frame.depth))
    found = np.zeros(frame.depth.shape, dtype=bool)
    inverse = 1.0 / frame.depth[rows, columns].astype(np.float64)  # linear in the image for a plane
    design = np.stack([rows, columns, np.ones(len(rows))], axis=1).astype(np.float64)
    rng = np.random.default_rng(0)
    best, votes = np.zeros(3), -1
    for _ in range(200):
        three = rng.choice(len(rows), 3, replace=False)
        try:
            plane = np.linalg.solve(design[three], inverse[three])
        except np.linalg.LinAlgError:
            continue
        near = np.count_nonzero(np.abs(1.0 / inverse - 1.0 / (design @ plane)) < height / 2)
        if near > votes:
            best, votes = plane, near
    found[rows, columns] = 1.0 / (design @ best) - 1.0 / inverse > height
    return found
