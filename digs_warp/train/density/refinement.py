"""The result of a refinement: the Gaussians to continue with, and where each one came from."""

from dataclasses import dataclass

import numpy as np

from digs_warp.data.gaussians import Gaussians


@dataclass(frozen=True, eq=False)
class Refinement:
    """A new population of m Gaussians.

    Attributes:
        gaussians: the raw parameters.
        sources: row of the old population that each Gaussian comes from, shape (m,), int64.
        keeps_moments: whether it also keeps that row's optimizer moments, shape (m,), bool; otherwise they
            start at zero.
        restarted: names of the parameters whose moments are reset to zero for all Gaussians.
    """

    gaussians: Gaussians
    sources: np.ndarray
    keeps_moments: np.ndarray
    restarted: tuple[str, ...] = ()

    def moments(self, name: str, values: np.ndarray) -> np.ndarray:
        """Return the moments of the new population from ``values`` of the old one, float32.

        Args:
            name: the parameter, one of `digs_warp.data.gaussians.FIELDS`.
            values: first or second moments, shape (n, ...).
        """
        moved = values[self.sources]
        moved[slice(None) if name in self.restarted else ~self.keeps_moments] = 0.0
        return moved


def unchanged(gaussians: Gaussians) -> Refinement:
    """Return the same Gaussians, with their moments."""
    count = len(gaussians)
    return Refinement(gaussians, np.arange(count), np.ones(count, dtype=bool))


def rotation_matrices(quats: np.ndarray) -> np.ndarray:
    """Return the rotations of raw quaternions (n, 4), xyzw, shape (n, 3, 3); zero means no rotation."""
    lengths = np.linalg.norm(quats, axis=1, keepdims=True)
    unit = np.where(lengths > 0, quats / np.where(lengths > 0, lengths, 1.0), [0.0, 0.0, 0.0, 1.0])
    vector, w = unit[:, :3], unit[:, 3, None, None]
    x, y, z = vector.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    # Rodrigues: R = I + 2 w [v]x + 2 [v]x^2
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
