"""Float64 twin of unpack.js: what the page makes of the words of `digs_warp.show.report.view3d.pack`."""

from dataclasses import dataclass

import numpy as np

from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.show.report.view3d.pack import PackedSplats


@dataclass(frozen=True, eq=False)
class UnpackedSplats:
    """Centers (n, 3) [m], covariances (n, 3, 3) [m^2], colors (n, 3) and opacities (n,) in 0..1.

    ``harmonics``: coefficients above band 0, (n, K - 1, 3).
    """

    centers: np.ndarray
    covariances: np.ndarray
    colors: np.ndarray
    opacities: np.ndarray
    harmonics: np.ndarray


def unpacked(packed: PackedSplats) -> UnpackedSplats:
    words = packed.words.astype(np.int64)
    centers = packed.low + (words[:, :3] & 0xFFFFFF) * packed.step
    scales = np.exp(packed.log_low + (words[:, :3] >> 24) * packed.log_step)
    quats = np.zeros((len(words), 4))
    for i, word in enumerate(words[:, 3]):
        largest = word >> 30
        small = [((word >> shift) & 1023) / 1023 * 2**0.5 - 0.5**0.5 for shift in (0, 10, 20)]
        quats[i, [k for k in range(4) if k != largest]] = small
        quats[i, largest] = max(0.0, 1.0 - sum(value**2 for value in small)) ** 0.5
    axes = matrix_from_quat_xyzw(quats) * scales[:, None, :]
    rgba = (words[:, 4, None] >> np.array([0, 8, 16, 24])) & 255
    harmonics = packed.harmonic_step * packed.harmonics
    covariances = axes @ axes.transpose(0, 2, 1)
    return UnpackedSplats(centers, covariances, rgba[:, :3] / 255, rgba[:, 3] / 255, harmonics)
