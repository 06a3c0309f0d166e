"""The box around splats, which contains every ellipsoid of three standard deviations. NumPy only."""

import numpy as np

from digs_warp.usd.convert import SplatArrays

# Rows handled at a time: the many intermediate arrays stay in the cache.
CHUNK = 8192


def three_sigma_extent(arrays: SplatArrays) -> np.ndarray:
    """Return the corners (minimum, maximum), float32 (2, 3), of the box around every 3-sigma ellipsoid.

    The ellipsoid of covariance ``R S^2 R^T`` reaches ``3 sqrt(diag(R S^2 R^T))`` along the axes. The box
    of no splats is USD's empty one (minimum above maximum).
    """
    largest = float(np.finfo(np.float32).max)
    low, high = np.full(3, largest), np.full(3, -largest)
    if len(arrays) == 0:
        return np.stack([low, high]).astype(np.float32)
    for first in range(0, len(arrays), CHUNK):
        rows = slice(first, first + CHUNK)
        reach = 3.0 * np.sqrt(_variances(arrays.orientations[rows], arrays.scales[rows]))
        centers = _columns(arrays.positions[rows])
        low = np.minimum(low, (centers - reach).min(axis=1))
        high = np.maximum(high, (centers + reach).max(axis=1))
    # Rounded outwards.
    box = np.clip(np.stack([low, high]), -largest, largest).astype(np.float32)
    outside = np.array([[-largest], [largest]], dtype=np.float32)
    return np.nextafter(box, outside)


def _variances(quats: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Return the variances along x, y and z, shape (3, n), of ellipsoids; a zero quaternion is no rotation.

    The entries of the rotation matrix, homogeneous in the quaternion, are written out over columns:
    six times as fast as matrices, because no array has a short axis.
    """
    x, y, z, w = _columns(quats)
    a, b, c = _columns(scales) ** 2
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    norm = xx + yy + zz + ww
    none = norm == 0
    ww[none] = norm[none] = 1.0
    xy, xz, yz, wx, wy, wz = x * y, x * z, y * z, w * x, w * y, w * z
    variances = np.empty((3, len(norm)))
    variances[0] = (xx + ww - yy - zz) ** 2 * a + 4 * ((xy - wz) ** 2 * b + (xz + wy) ** 2 * c)
    variances[1] = (yy + ww - xx - zz) ** 2 * b + 4 * ((xy + wz) ** 2 * a + (yz - wx) ** 2 * c)
    variances[2] = (zz + ww - xx - yy) ** 2 * c + 4 * ((xz - wy) ** 2 * a + (yz + wx) ** 2 * b)
    variances /= norm * norm
    return variances


def _columns(rows: np.ndarray) -> np.ndarray:
    """Return float64 columns, each in one piece: rounding must not push an ellipsoid out of its box."""
    return np.ascontiguousarray(rows.T, dtype=np.float64)
