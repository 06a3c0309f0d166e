"""The code under test: how far a robot can drive. Put your own in its place; it need not know digs-warp."""

import numpy as np

NEAREST = 0.05  # share of the pixels; the very nearest ones are mostly noise


def free_distance(depth: np.ndarray) -> float:
    """Return the distance to the nearest thing in the middle of the view [m].

    Args:
        depth: planar depth [m], (height, width), NaN where unknown.
    """
    height, width = depth.shape
    middle = depth[height // 4 : -height // 4, width // 4 : -width // 4]
    known = np.sort(middle[np.isfinite(middle)])
    return float(np.mean(known[: max(1, round(NEAREST * len(known)))]))
