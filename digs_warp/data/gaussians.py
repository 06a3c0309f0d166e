"""The Gaussians of a scene: raw parameters for the optimizer, activated values for a renderer."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.geometry.sh import degree_from_count
from digs_warp.record.arrays import open_arrays, write_arrays

FIELDS = ("means", "log_scales", "quats", "opacity_logits", "sh")


@dataclass(frozen=True, eq=False)
class Gaussians:
    """Raw, optimized parameters of n Gaussians, all float32.

    Attributes:
        means: centers in the world [m], shape (n, 3).
        log_scales: natural logarithm of the standard deviations [m] along the local axes, (n, 3).
        quats: rotations world-from-local, xyzw, not normalized, (n, 4); zero means no rotation.
        opacity_logits: logit of the opacity, (n,).
        sh: spherical-harmonics coefficients of the color in sRGB, (n, K, 3), see `digs_warp.geometry.sh`.
    """

    means: np.ndarray
    log_scales: np.ndarray
    quats: np.ndarray
    opacity_logits: np.ndarray
    sh: np.ndarray

    def __post_init__(self) -> None:
        for name in FIELDS:
            value = np.ascontiguousarray(getattr(self, name), dtype=np.float32)
            object.__setattr__(self, name, value)
        count = len(self.means)
        check_shape("Gaussians.means", self.means, (count, 3))
        check_shape("Gaussians.log_scales", self.log_scales, (count, 3))
        check_shape("Gaussians.quats", self.quats, (count, 4))
        check_shape("Gaussians.opacity_logits", self.opacity_logits, (count,))
        check_shape("Gaussians.sh", self.sh, (count, None, 3))
        degree_from_count(self.sh.shape[1])

    def __len__(self) -> int:
        return len(self.means)

    @property
    def sh_degree(self) -> int:
        """Degree of the spherical harmonics, 0 to 3."""
        return degree_from_count(self.sh.shape[1])

    @property
    def scales(self) -> np.ndarray:
        """Standard deviations [m], shape (n, 3)."""
        return np.exp(self.log_scales)

    @property
    def opacities(self) -> np.ndarray:
        """Opacities in 0..1, shape (n,)."""
        from scipy.special import expit  # imported here to keep `digs-warp --help` fast

        return expit(self.opacity_logits.astype(np.float64)).astype(np.float32)

    def select(self, keep: np.ndarray | slice) -> "Gaussians":
        """Return the Gaussians at ``keep``: a bool mask, (n,), indices, or a slice (a view)."""
        return Gaussians(*(getattr(self, name)[keep] for name in FIELDS))

    def save(self, path: Path) -> None:
        """Write an ``.npz`` with one array per field; the file appears only when complete."""
        write_arrays(path, {name: getattr(self, name) for name in FIELDS})

    @staticmethod
    def load(path: Path) -> "Gaussians":
        """Read a file that `save` wrote.

        Raises:
            DigsError: the file is missing, truncated, or lacks a field.
        """
        with open_arrays(path, "Gaussians", FIELDS) as arrays:
            return Gaussians(**{name: arrays[name] for name in FIELDS})
