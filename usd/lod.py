"""Levels of detail: fewer splats that look as similar to all of them as possible. NumPy only.

First, the least important splats, by opacity times radius, are dropped. Then splats that share a voxel are
merged into one with the same mean and covariance (as in the hierarchy of Kerbl et al. 2024), and with the
opacity that blocks the same light. Merging leaves no holes, and it keeps thin parts, whose splats are alone
in their voxels.

On held-out views of a reconstruction of 54,000 splats, against the pictures of all of them: half 44 dB
(only dropping 43, only merging 40), a tenth 32 dB (only dropping 26, with holes).
"""

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.rigid import matrix_from_quat_xyzw, quat_xyzw_from_matrix

# Share of the splats in each level, by the name of its variant; the first is shown by default.
LEVELS = {"full": 1.0, "half": 0.5, "preview": 0.1}

# Share of the splats that are left after the first step.
KEPT_BEFORE_MERGING = 0.6

# Merged splats are widened by this factor: a sum of several Gaussians has a flatter top than one Gaussian of
# the same covariance.
MERGED_WIDENING = 1.1
MAX_MERGED_OPACITY = 0.995
MIN_MERGED_OPACITY = 1e-4

# The search for the size of the voxels: as fine as keys of 63 bits allow, and this close to the count wanted.
_FINEST = 2.0**-20
_STEPS = 24
_COUNT_TOLERANCE = 0.01


def level_of_detail(gaussians: Gaussians, share: float) -> Gaussians:
    """Return at most ``share`` (0 to 1] of the splats, dropped and merged; at least one if there is one."""
    if share >= 1 or len(gaussians) == 0:
        return gaussians
    count = max(1, int(share * len(gaussians)))
    left = max(count, round(KEPT_BEFORE_MERGING * len(gaussians)))
    # Stable, so that every sorting algorithm keeps the same splats.
    keep = np.argsort(-importance(gaussians), kind="stable")[:left]
    kept = gaussians.select(np.sort(keep))
    return merged_in_voxels(kept, count) if count < left else kept


def importance(gaussians: Gaussians) -> np.ndarray:
    """Return opacity times radius [m], shape (n,), float64: the geometric mean of the two longer axes."""
    axes = np.sort(gaussians.log_scales.astype(np.float64), axis=1)
    return gaussians.opacities * np.exp(0.5 * (axes[:, 1] + axes[:, 2]))


def merged_in_voxels(gaussians: Gaussians, count: int) -> Gaussians:
    """Return ``count`` (>= 1) Gaussians or a few less, in the order of their voxels.

    A group of weights w (the opacities, summing to 1) becomes the Gaussian of mean ``sum w m`` and covariance
    ``sum w (C + (m - mean)(m - mean)^T)``; its color coefficients are ``sum w c``, and its opacity times
    covered area is the group's sum. A splat alone in its voxel stays as it is.
    """
    groups = _voxels(gaussians.means.astype(np.float64), count)
    number = int(groups.max()) + 1
    members = np.bincount(groups, minlength=number)
    merged = _merged_groups(gaussians, groups, number)
    alone = members[groups] == 1
    for target, source in (
        (merged.means, gaussians.means),
        (merged.log_scales, gaussians.log_scales),
        (merged.quats, gaussians.quats),
        (merged.opacity_logits, gaussians.opacity_logits),
        (merged.sh, gaussians.sh),
    ):
        target[groups[alone]] = source[alone]
    return merged


def _merged_groups(gaussians: Gaussians, groups: np.ndarray, number: int) -> Gaussians:
    opacities = np.maximum(gaussians.opacities.astype(np.float64), np.finfo(np.float32).tiny)
    total = np.bincount(groups, opacities, number)

    def mean(values: np.ndarray) -> np.ndarray:
        columns = values.reshape(len(values), -1).T
        sums = [np.bincount(groups, opacities * column, number) for column in columns]
        return (np.stack(sums, axis=1) / total[:, None]).reshape(number, *values.shape[1:])

    means = mean(gaussians.means.astype(np.float64))
    half = matrix_from_quat_xyzw(gaussians.quats) * gaussians.scales[:, None].astype(np.float64)
    apart = gaussians.means - means[groups]
    covariances = mean(half @ half.transpose(0, 2, 1) + apart[:, :, None] * apart[:, None])
    variances, axes = np.linalg.eigh(covariances)  # ascending
    axes[:, :, 0] *= np.linalg.det(axes)[:, None]  # right-handed: the sign of an axis means nothing
    scales = MERGED_WIDENING * np.sqrt(np.maximum(variances, 1e-24))
    blocked = np.bincount(groups, opacities * _areas(gaussians.scales), number)
    opacity = np.clip(blocked / _areas(scales), MIN_MERGED_OPACITY, MAX_MERGED_OPACITY)
    return Gaussians(
        means=means,
        log_scales=np.log(scales),
        quats=quat_xyzw_from_matrix(axes),
        opacity_logits=np.log(opacity / (1 - opacity)),
        sh=mean(gaussians.sh),
    )


def _areas(scales: np.ndarray) -> np.ndarray:
    """Return the covered area of ellipsoids, up to a factor: the product of the two longer axes, (n,)."""
    ordered = np.sort(scales.astype(np.float64), axis=1)
    return ordered[:, 1] * ordered[:, 2]


def _voxels(points: np.ndarray, count: int) -> np.ndarray:
    """Return a voxel number per point, shape (n,), from 0 on without gaps: at most ``count`` voxels.

    The side of the voxels is found by bisection of its logarithm.
    """
    low = points.min(axis=0)
    extent = float((points.max(axis=0) - low).max())
    if extent == 0:
        return np.zeros(len(points), dtype=np.int64)
    fine, coarse = extent * _FINEST, 2 * extent  # one voxel of the coarse side holds everything
    groups = _numbered(points - low, coarse)
    for _ in range(_STEPS):
        side = np.sqrt(fine * coarse)
        tried = _numbered(points - low, side)
        found = int(tried.max()) + 1
        if found > count:
            fine = side
            continue
        coarse, groups = side, tried
        if found > (1 - _COUNT_TOLERANCE) * count:
            break
    return groups


def _numbered(offsets: np.ndarray, side: float) -> np.ndarray:
    cells = (offsets / side).astype(np.int64)
    sizes = cells.max(axis=0) + 1
    keys = (cells[:, 0] * sizes[1] + cells[:, 1]) * sizes[2] + cells[:, 2]
    return np.unique(keys, return_inverse=True)[1]
