"""How views vote on points, in plain NumPy."""

from collections.abc import Sequence

import numpy as np

from digs_warp.measure.thumbnails import SmallDepth, pixels_showing


def votes_on(points_world: np.ndarray, voters: Sequence[SmallDepth]) -> np.ndarray:
    """Return how many of the voters vote on each point, and how many for the object, (n, 2)."""
    votes = np.zeros((len(points_world), 2), dtype=np.int64)
    for voter in voters:
        assert voter.mask is not None
        pixel, depth = pixels_showing(voter.camera, points_world)
        measured = voter.depth.reshape(-1)[pixel]
        with np.errstate(invalid="ignore"):
            sees = (pixel >= 0) & (np.abs(measured - depth) < 0.05 * depth)
        votes[:, 0] += sees
        votes[:, 1] += sees & voter.mask.reshape(-1)[pixel]
    return votes
