"""Working range, disparity steps, and holes of a camera, from its recording of a wall."""

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
from digs_warp.sim.sensor.filters import patch_areas

# An end is seen where the wall goes on beyond it by this share, over this many pixels without depth.
BEYOND = 0.02
EMPTY_PIXELS = 500

# How exactly an end is known follows from the distances between this many values next to it.
LAST_VALUES = 20

# Steps that cameras have: powers of 1/2, down to this [px].
FINEST_STEP = 1 / 64

# Values count as multiples of a step if they miss it by less than this share of it; most have to.
MISS, MOST = 0.02, 0.98


def depth_range(wall: Wall) -> tuple[float, float]:
    """Return the nearest and the farthest depth that the camera reported [m]."""
    smallest, largest = _extremes(wall)
    return wall.focal_baseline / largest, wall.focal_baseline / smallest


def limits(wall: Wall) -> tuple[Estimate, Estimate]:
    """Return the nearest and the farthest depth that the camera can report [m].

    Unknown where the wall does not go on beyond what the camera reported: then the range is at least that.
    """
    smallest, largest = _extremes(wall)
    near = _end(wall, largest, 1) if _is_empty(wall, largest * (1 + BEYOND), 1) else UNKNOWN
    far = _end(wall, smallest, -1) if _is_empty(wall, smallest * (1 - BEYOND), -1) else UNKNOWN
    return near, far


def in_both_eyes(disparity: np.ndarray) -> np.ndarray:
    """Return where the right eye sees what the left one sees, as far as the image goes, bool."""
    return disparity <= np.arange(disparity.shape[1]) + 0.5


def is_measurable(pose: Pose, plane: np.ndarray) -> np.ndarray:
    """Return where depth could be, and both eyes see the wall, bool.

    Args:
        pose: of the camera.
        plane: its plane at every pixel [px], (height, width).
    """
    return pose.looked & in_both_eyes(plane)


def _extremes(wall: Wall) -> tuple[float, float]:
    """Return the smallest and the largest disparity that the camera reported [px]."""
    lows, highs = zip(
        *((np.nanmin(p.disparity), np.nanmax(p.disparity)) for p in wall.poses), strict=True
    )
    return float(min(lows)), float(max(highs))


def _is_empty(wall: Wall, end: float, sign: int) -> bool:
    """Whether the wall goes on beyond a disparity."""
    count = 0
    for pose in wall.poses:
        plane = pose.plane.disparity(wall.shape)
        count += np.count_nonzero((sign * plane > sign * end) & is_measurable(pose, plane))
    return bool(count >= EMPTY_PIXELS)


def _end(wall: Wall, end: float, sign: int) -> Estimate:
    """Return the depth at the last disparity that is reported; its error is the gap to its neighbors."""
    values = np.concatenate([_near(pose, end) for pose in wall.poses])
    last = np.sort(sign * np.unique(values))[::-1][:LAST_VALUES]
    gap = float(np.abs(np.diff(last)).mean()) if len(last) > 1 else end
    depth = wall.focal_baseline / end
    return Estimate(depth, depth * gap / end + 1e-6 * depth)


def _near(pose: Pose, end: float) -> np.ndarray:
    return pose.disparity[np.abs(pose.disparity - end) < 0.1 * end]


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


# Holes of up to this many pixels are small.
SMALL = 3


def holes(wall: Wall) -> dict[str, Estimate]:
    """Return shares of the wall, 0 to 1, where both eyes see it and within the range that was reported.

    ``holes``: without depth; ``wrong``: of the depths, those off the wall; ``small holes``: of the hole area,
    what lies in holes of up to three pixels; ``hole size``: half of the hole area is in smaller holes [px];
    ``hole count``: connected holes in 10,000 pixels.
    """
    blocks = block_numbers(wall.shape)
    nearest, farthest = depth_range(wall)
    missing, wrong, sizes, counts = [], [], [], []
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
            counts.append(1e4 * len(sizes[-1]) / max(np.count_nonzero(inside), 1))
    return {
        "holes": jackknife(np.sum(missing, axis=0), ratio),
        "wrong": jackknife(np.sum(wrong, axis=0), ratio),
        "small holes": _mean([small_share(s) for s in sizes]),
        "hole size": _mean([median_size(s) for s in sizes]),
        "hole count": _mean(counts),
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
