"""Noise of disparity on a wall: its size, what of it changes, what always stays.

The residual to the wall's plane is split by its mean over the frames of a pose. With n frames, temporal
variance t and fixed variance f, the mean of a pixel has the variance f + t / n.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from digs_warp.sim.fit.estimate import (
    UNKNOWN,
    Estimate,
    block_numbers,
    block_sums,
    jackknife,
    ratio,
)
from digs_warp.sim.fit.wall import Pose, Wall


def residuals(pose: Pose) -> np.ndarray:
    """Return disparity minus plane where it is near it [px], (frames, height, width), NaN elsewhere."""
    residual = pose.disparity - pose.plane.disparity(pose.disparity.shape[1:]).astype(np.float32)
    residual[~(np.abs(residual) <= pose.plane.limit)] = np.nan
    return residual


class Moments:
    """Mean and spread of the residual of each pixel over the frames of a pose.

    Attributes:
        count: of frames with a value, (height, width).
        mean: [px], float64, NaN where there is none.
        variance: over the frames, unbiased [px^2], NaN where there are fewer than two.
    """

    def __init__(self, residual: np.ndarray) -> None:
        self.count = np.isfinite(residual).sum(axis=0)
        some = np.where(self.count > 0, self.count, np.nan)
        self.mean = np.nansum(residual, axis=0, dtype=np.float64) / some
        square = np.nansum((residual - self.mean) ** 2, axis=0, dtype=np.float64)
        self.variance = square / np.where(self.count > 1, self.count - 1, np.nan)


def noise(wall: Wall) -> dict[str, Estimate]:
    """Return the noise figures of a wall [px]; unknown where there are too few frames or poses.

    ``sigma``: of all errors in one frame; ``temporal`` and ``fixed``: what changes between frames and what
    does not; ``static_field``: what the fixed parts of all poses have in common.
    """
    blocks = block_numbers(wall.shape)
    moments = [Moments(residuals(pose)) for pose in wall.poses]
    sums = np.sum([_variance_sums(one, blocks) for one in moments], axis=0)
    several = any((one.count > 1).any() for one in moments)
    return {
        "sigma": jackknife(sums, _total).root(),
        "temporal": jackknife(sums, _temporal).root() if several else UNKNOWN,
        "fixed": jackknife(sums, lambda s: _total(s) - _temporal(s)).root() if several else UNKNOWN,
        "static_field": static_field([one.mean for one in moments], blocks),
    }


def sigma_of(pose: Pose) -> Estimate:
    """Return the standard deviation of all errors in one frame of a pose [px]."""
    blocks = block_numbers(pose.disparity.shape[1:])
    return jackknife(_variance_sums(Moments(residuals(pose)), blocks), _total).root()


def _variance_sums(moments: Moments, blocks: np.ndarray) -> np.ndarray:
    """Return sums of each block: squared residuals, their number, squared deviations, their freedom."""
    count, variance = moments.count, moments.variance
    deviations = np.where(count > 1, variance * (count - 1), 0.0)
    squares = deviations + np.where(count > 0, count * moments.mean**2, 0.0)
    freedom = np.maximum(count - 1, 0)
    return np.stack(
        [block_sums(x.astype(float), blocks) for x in (squares, count, deviations, freedom)], axis=1
    )


def _total(sums: np.ndarray) -> float:
    return sums[0] / sums[1]


def _temporal(sums: np.ndarray) -> float:
    return sums[2] / sums[3]


def static_field(means: Sequence[np.ndarray], blocks: np.ndarray) -> Estimate:
    """Return the standard deviation of what residuals at different poses have in common [px].

    The mean product of two poses: what belongs to the texture differs between them and averages out.

    Args:
        means: residuals to the plane, mean over the frames, each (height, width), NaN where unknown.
        blocks: see `block_numbers`.
    """
    if len(means) < 2:
        return UNKNOWN
    products = [first * second for first, second in combinations(means, 2)]
    sums = sum(
        np.stack(
            [block_sums(p, blocks), block_sums(np.where(np.isfinite(p), 1.0, np.nan), blocks)],
            axis=1,
        )
        for p in products
    )
    return jackknife(np.asarray(sums), ratio).root()
