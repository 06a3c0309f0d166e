"""Noise of disparity on a wall: its size, what of it changes, how far it is correlated, what always stays.

The residual to the wall's plane is split by its mean over the frames of a pose. With n frames, temporal
variance t and fixed variance f, the mean of a pixel has the variance f + t / n.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from digs_warp.sim.fit.estimate import (
    BLOCKS,
    UNKNOWN,
    Estimate,
    block_numbers,
    block_sums,
    jackknife,
    ratio,
)
from digs_warp.sim.fit.wall import Pose, Wall

# Distances at which the correlation is measured [px].
LAGS = (0, 1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48)

# Correlation of the part that changes is measured on this many frames of a pose.
CORRELATED_FRAMES = 3


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
    does not; ``static_field``: what the fixed parts of all poses have in common; ``correlation``: distance at
    which the correlation of the temporal part has fallen to 1/e, mean of rows and columns.
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
        "correlation": _correlation_length(wall.poses, blocks) if several else UNKNOWN,
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


def _correlation_length(poses: Sequence[Pose], blocks: np.ndarray) -> Estimate:
    return _length(sum(_lag_sums(part, blocks) for part in _changing(poses)))


def _changing(poses: Sequence[Pose]) -> Iterator[np.ndarray]:
    """Yield the residuals of some frames minus their mean over the frames of the pose."""
    for pose in poses:
        residual = residuals(pose)
        if len(residual) > 1:
            moments = Moments(residual)
            mean = np.where(moments.count > 1, moments.mean, np.nan)
            yield from (frame - mean for frame in residual[:CORRELATED_FRAMES])


def _lag_sums(residual: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """Return sums of products at each lag along rows and columns, then their numbers, (BLOCKS, 2 * lags)."""
    products, counts = np.zeros((BLOCKS, len(LAGS))), np.zeros((BLOCKS, len(LAGS)))
    for number, lag in enumerate(LAGS):
        for axis in (0, 1):
            size = residual.shape[axis]
            if lag >= size:
                continue
            here, there = (
                np.take(residual, range(*ends), axis) for ends in ((0, size - lag), (lag, size))
            )
            product = here * there
            at = np.take(blocks, range(size - lag), axis)
            known = np.isfinite(product)
            products[:, number] += np.bincount(at[known], product[known], BLOCKS)
            counts[:, number] += np.bincount(at[known], minlength=BLOCKS)
    return np.concatenate([products, counts], axis=1)


def _length(sums: np.ndarray | int) -> Estimate:
    return jackknife(np.asarray(sums), _crossing) if np.ndim(sums) else UNKNOWN


def _crossing(sums: np.ndarray) -> float:
    """Return where the correlation crosses 1/e, interpolated linearly; the last lag where it does not."""
    covariance = sums[: len(LAGS)] / np.maximum(sums[len(LAGS) :], 1)
    correlation = covariance / covariance[0]
    below = np.flatnonzero(correlation < np.exp(-1))
    if len(below) == 0:
        return float(LAGS[-1])
    after = below[0]
    high, low = correlation[after - 1], correlation[after]
    share = (high - np.exp(-1)) / (high - low)
    return LAGS[after - 1] + share * (LAGS[after] - LAGS[after - 1])
