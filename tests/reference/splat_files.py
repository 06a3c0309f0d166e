"""Gaussians for tests of file formats, and what makes two sets of them the same scene."""

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.rigid import matrix_from_quat_xyzw


def random_gaussians(count: int, degree: int = 3, seed: int = 0) -> Gaussians:
    """Gaussians with values in every range that trained scenes have; quaternions not normalized."""
    rng = np.random.default_rng(seed)
    return Gaussians(
        means=rng.uniform(-2.0, 2.0, (count, 3)),
        log_scales=rng.uniform(-9.0, 1.0, (count, 3)),
        quats=rng.normal(size=(count, 4)) * rng.uniform(0.1, 3.0, (count, 1)),
        opacity_logits=rng.uniform(-6.0, 6.0, count),
        sh=np.concatenate(
            [
                rng.uniform(-1.5, 1.5, (count, 1, 3)),
                rng.uniform(-0.5, 0.5, (count, (degree + 1) ** 2 - 1, 3)),
            ],
            axis=1,
        ),
    )


def shapes(gaussians: Gaussians) -> np.ndarray:
    """R diag(s) R^T of each, (n, 3, 3), s the logarithm of the scales.

    The same for all quaternions that mean the same ellipsoid, and as exact for flat as for round ones.
    """
    rotations = matrix_from_quat_xyzw(gaussians.quats)
    return np.einsum("nij,nj,nkj->nik", rotations, gaussians.log_scales, rotations)
