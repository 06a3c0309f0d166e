"""Pixels of a wall without depth, or with a wrong one: how many, and in holes of which size."""

import numpy as np

from digs_warp.sim.fit.estimate import Estimate, block_numbers, block_sums, jackknife, ratio
from digs_warp.sim.fit.range_and_step import depth_range, is_measurable
from digs_warp.sim.fit.wall import Wall
from digs_warp.sim.sensor.filters import patch_areas

# Holes of up to this many pixels are small.
SMALL = 3


def holes(wall: Wall) -> dict[str, Estimate]:
    """Return shares of the wall, 0 to 1, where both eyes see it and within the range that was reported.

    ``holes``: without depth; ``wrong``: of the depths, those off the wall; ``small holes``: of the hole area,
    what lies in holes of up to three pixels; ``hole size``: half of the hole area is in smaller holes [px].
    """
    blocks = block_numbers(wall.shape)
    nearest, farthest = depth_range(wall)
    missing, wrong, sizes = [], [], []
    for pose in wall.poses:
        plane = pose.plane.disparity(wall.shape)
        depth = wall.focal_baseline / plane
        inside = is_measurable(pose, plane) & (depth >= nearest) & (depth <= farthest)
        for frame in pose.disparity:
            hole = inside & np.isnan(frame)
            missing.append(_shares(hole, inside, blocks))
            off = np.abs(frame - plane) > pose.plane.limit
            wrong.append(_shares(off & inside, inside & ~np.isnan(frame), blocks))
            sizes.append(patch_areas(hole))
    return {
        "holes": jackknife(np.sum(missing, axis=0), ratio),
        "wrong": jackknife(np.sum(wrong, axis=0), ratio),
        "small holes": _mean([small_share(s) for s in sizes]),
        "hole size": _mean([median_size(s) for s in sizes]),
    }


def _shares(part: np.ndarray, whole: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    return np.stack([block_sums(x.astype(float), blocks) for x in (part, whole)], axis=1)


def small_share(sizes: np.ndarray) -> float:
    """Return the share of the hole area in small holes; NaN where there are no holes."""
    return float(sizes[sizes <= SMALL].sum() / sizes.sum()) if len(sizes) else np.nan


def median_size(sizes: np.ndarray) -> float:
    """Return the size of hole that half of the hole area is below [px]; NaN where there are no holes."""
    if len(sizes) == 0:
        return np.nan
    ordered = np.sort(sizes)
    return float(ordered[np.searchsorted(np.cumsum(ordered), ordered.sum() / 2)])


def _mean(values: list[float]) -> Estimate:
    known = np.array([value for value in values if np.isfinite(value)])
    if len(known) == 0:
        return Estimate(np.nan, np.nan)
    error = known.std(ddof=1) / np.sqrt(len(known)) if len(known) > 1 else np.nan
    return Estimate(float(known.mean()), float(error))
