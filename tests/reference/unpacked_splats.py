"""Float64 twin of unpack.js: what the page makes of the words of `digs_warp.show.report.view3d.pack`."""

from typing import NamedTuple

import numpy as np

from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.show.report.view3d.pack import PackedSplats


class UnpackedSplats(NamedTuple):
    """Centers [m], covariances [m^2], colors and opacities in 0..1, coefficients above band 0."""

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
        small = [((word >> shift) & 1023) / 1023 * 2**0.5 - 0.5**0.5 for shift in (0, 10, 20)]
        quats[i, np.arange(4) != word >> 30] = small
        quats[i, word >> 30] = max(0.0, 1.0 - sum(value**2 for value in small)) ** 0.5
    axes = matrix_from_quat_xyzw(quats) * scales[:, None, :]
    rgba = ((words[:, 4, None] >> np.array([0, 8, 16, 24])) & 255) / 255
    covariances, harmonics = axes @ axes.transpose(0, 2, 1), packed.harmonic_step * packed.harmonics
    return UnpackedSplats(centers, covariances, rgba[:, :3], rgba[:, 3], harmonics)
