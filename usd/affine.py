"""Splats under any invertible transform: exact shapes, colors under the nearest rotation. NumPy only."""

from dataclasses import replace

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.geometry.rigid import matrix_from_quat_xyzw, quat_xyzw_from_matrix
from digs_warp.geometry.sh import rotate_sh
from digs_warp.usd.convert import SplatArrays

# Splats per chunk, because of the (n, 3, 3) arrays.
CHUNK = 65536


def deformed(
    arrays: SplatArrays, b_from_a: np.ndarray, what: str, sh_out: np.ndarray | None = None
) -> SplatArrays:
    """Return the splats of frame a in frame b under an affine ``b_from_a``, shape (4, 4).

    A Gaussian of covariance C becomes one of ``L C L^T``, L the linear part: exact, even if L mirrors, shears
    or scales the axes differently. There is no such rule for view-dependent colors: they are rotated (or
    mirrored) by the orthogonal factor of L's polar decomposition, which is exact for similarities.
    ``sh_out`` takes the coefficients where it is given.

    Raises:
        UsdError: the transform collapses a direction or is not finite.
    """
    linear = b_from_a[:3, :3]
    if not np.isfinite(b_from_a).all() or abs(np.linalg.det(linear)) < np.finfo(np.float64).tiny:
        raise UsdError(
            f"{what}: the transform collapses or is not finite; expected an invertible one. Bake it first."
        )
    u, _, vt = np.linalg.svd(linear)
    chunks = [
        _turned_shapes(arrays.orientations[i : i + CHUNK], arrays.scales[i : i + CHUNK], linear)
        for i in range(0, len(arrays), CHUNK)
    ]
    orientations = np.concatenate([quats for quats, _ in chunks] or [arrays.orientations])
    scales = np.concatenate([scales for _, scales in chunks] or [arrays.scales])
    return replace(
        arrays,
        positions=(arrays.positions @ linear.T + b_from_a[:3, 3]).astype(np.float32),
        orientations=orientations.astype(np.float32),
        scales=scales.astype(np.float32),
        sh=rotate_sh(arrays.sh, u @ vt, sh_out),
    )


def _turned_shapes(
    quats: np.ndarray, scales: np.ndarray, linear: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return quaternions (n, 4) and scales (n, 3) whose covariances are ``L R S^2 R^T L^T``."""
    # The left singular vectors of L R S are the axes, the singular values the scales: no squares, so
    # that flat splats keep their thin side.
    half = linear @ (matrix_from_quat_xyzw(quats) * scales[:, None, :].astype(np.float64))
    axes, values, _ = np.linalg.svd(half)
    axes[:, :, 2] *= np.linalg.det(axes)[:, None]  # right-handed: the sign of an axis means nothing
    return quat_xyzw_from_matrix(axes), values
