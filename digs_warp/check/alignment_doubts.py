"""Depth that is not registered to the images: its edges lie beside those of the images."""

from collections.abc import Sequence

import numpy as np

from digs_warp.check.finding import Finding
from digs_warp.check.small_frames import SmallFrame

# Offsets up to this many thumbnail pixels are tried.
REACH = 10

# A depth edge: depth changes by this share over two thumbnail pixels.
EDGE = 0.1

# Fewer edges in a thumbnail say nothing.
ENOUGH = 30

# A shift counts from this many thumbnail pixels on; noise and the sensor's windows move edges by less.
SHIFT = 3

# At the best offset, the contrast of the images at depth edges (in standard deviations above its mean) is at
# least this, exceeds the contrast without a shift by this factor and difference ...
CONTRAST, BETTER, MARGIN = 0.25, 1.3, 0.12

# ... and by this difference the contrast at offsets this many thumbnail pixels away: a peak, not a slope.
PEAK, AROUND = 0.1, 4


def alignment_doubts(frames: Sequence[SmallFrame]) -> list[Finding]:
    """Return a finding if depth edges meet image edges much better after a shift."""
    contrasts = [found for frame in frames if (found := _contrast(frame)) is not None]
    if 2 * len(contrasts) < len(frames):
        return []
    contrast = np.mean(contrasts, axis=0)
    row, column = np.unravel_index(int(np.argmax(contrast)), contrast.shape)
    down, right = int(row) - REACH, int(column) - REACH
    best, as_recorded = contrast[row, column], contrast[REACH, REACH]
    if max(abs(down), abs(right)) < SHIFT or best < max(CONTRAST, BETTER * as_recorded + MARGIN):
        return []
    if best < _around(contrast, int(row), int(column)) + PEAK:
        return []
    return [not_aligned(right, down, frames[0])]


def not_aligned(right: int, down: int, frame: SmallFrame) -> Finding:
    """Return the finding that the depth fits after a move by thumbnail pixels."""
    what = (
        f"The depth fits the images better if it is moved by {moved_by(right, down, frame)}: depth and "
        "images do not have the same camera."
    )
    return Finding("alignment", what, "Export depth that is registered to the color image.")


def moved_by(right: int, down: int, frame: SmallFrame) -> str:
    """Say how far a move by thumbnail pixels is."""
    width = frame.depth.shape[1]
    return (
        f"{abs(right) / width:.1%} of the width to the {'right' if right > 0 else 'left'} and "
        f"{abs(down) / width:.1%} {'down' if down > 0 else 'up'}"
    )


def _contrast(frame: SmallFrame) -> np.ndarray | None:
    """Return the mean image contrast at the depth edges for each offset, (2 REACH + 1, 2 REACH + 1)."""
    if min(frame.depth.shape) <= 2 * REACH + 2:
        return None
    log_depth = np.log(frame.depth)
    edges = np.zeros(frame.depth.shape, dtype=bool)
    edges[:, 1:-1] |= np.abs(log_depth[:, 2:] - log_depth[:, :-2]) > EDGE
    edges[1:-1] |= np.abs(log_depth[2:] - log_depth[:-2]) > EDGE
    rows, columns = np.nonzero(edges[REACH:-REACH, REACH:-REACH])
    down, right = np.gradient(frame.green)
    steepness = np.hypot(down, right)
    steepness = np.minimum(steepness, np.quantile(steepness, 0.95))
    if len(rows) < ENOUGH or steepness.std() == 0:
        return None
    steepness = (steepness - steepness.mean()) / steepness.std()
    offsets = range(2 * REACH + 1)
    return np.array(
        [[steepness[rows + row, columns + column].mean() for column in offsets] for row in offsets]
    )


def _around(contrast: np.ndarray, row: int, column: int) -> float:
    """Return the largest contrast AROUND pixels away from a place; infinite if it is near the rim."""
    size = contrast.shape[0]
    if not (AROUND <= row < size - AROUND and AROUND <= column < size - AROUND):
        return np.inf
    rows, columns = np.indices(contrast.shape)
    away = np.maximum(np.abs(rows - row), np.abs(columns - column))
    return float(contrast[away == AROUND].max())
