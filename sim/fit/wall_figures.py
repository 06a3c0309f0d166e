"""Figures of a wall: noise of the disparity, what of it changes and what always stays; holes and steps.

The residual to the wall's plane is split by its mean over the frames of a pose. With n frames, temporal
variance t and fixed variance f, the mean of a pixel has the variance f + t / n.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from digs_warp.sim.fit.device_figures import holes
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


# Steps that cameras have: powers of 1/2, down to this [px].
FINEST_STEP = 1 / 64

# Values count as multiples of a step if they miss it by less than this share of it; most have to.
MISS, MOST = 0.02, 0.98


def depth_range(wall: Wall) -> tuple[float, float]:
    """Return the nearest and the farthest depth that the camera reported [m]."""
    smallest = min(np.nanmin(pose.disparity) for pose in wall.poses)
    largest = max(np.nanmax(pose.disparity) for pose in wall.poses)
    return float(wall.focal_baseline / largest), float(wall.focal_baseline / smallest)


def disparity_step(wall: Wall) -> Estimate:
    """Return the step in which the camera reports disparity [px]; unknown where there is none to be seen."""
    values = np.concatenate([_sample(pose.disparity[0]) for pose in wall.poses]).astype(np.float64)
    step = 1.0
    while step >= FINEST_STEP:
        miss = np.abs(values / step - np.rint(values / step))
        if np.mean(miss < MISS) > MOST:
            return Estimate(step, 0.0)
        step /= 2
    return UNKNOWN


def _sample(disparity: np.ndarray) -> np.ndarray:
    known = disparity[np.isfinite(disparity)]
    return known[:: max(1, len(known) // 20_000)]


def wall_holes(wall: Wall) -> dict[str, Estimate]:
    """Return shares of the wall, 0 to 1, where both eyes see it and within the range that was reported.

    ``holes``: without depth; ``wrong``: of the depths, those off the wall; ``small holes``: of the hole area,
    what lies in holes of up to three pixels; ``hole count``: connected holes in 10,000 pixels.
    """
    blocks = block_numbers(wall.shape)
    nearest, farthest = depth_range(wall)
    missing, wrong, each = [], [], []
    for pose in wall.poses:
        plane = pose.plane.disparity(wall.shape)
        depth = wall.focal_baseline / plane
        # Where the right eye sees the wall, too.
        inside = pose.looked & (plane <= np.arange(plane.shape[1]) + 0.5)
        inside &= (depth >= nearest) & (depth <= farthest)
        for frame in pose.disparity:
            hole = inside & np.isnan(frame)
            missing.append(_shares(hole, inside, blocks))
            off = np.abs(frame - plane) > pose.plane.limit
            wrong.append(_shares(off & inside, inside & ~np.isnan(frame), blocks))
            each.append(holes(frame, inside))
    return {
        "holes": jackknife(np.sum(missing, axis=0), ratio),
        "wrong": jackknife(np.sum(wrong, axis=0), ratio),
        "small holes": _mean([found.small for found in each]),
        "hole count": _mean([found.per_10000 for found in each]),
    }


def _shares(part: np.ndarray, whole: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    return np.stack([block_sums(x.astype(float), blocks) for x in (part, whole)], axis=1)


def _mean(values: list[float]) -> Estimate:
    known = np.array([value for value in values if np.isfinite(value)])
    if len(known) == 0:
        return UNKNOWN
    error = known.std(ddof=1) / np.sqrt(len(known)) if len(known) > 1 else np.nan
    return Estimate(float(known.mean()), float(error))
