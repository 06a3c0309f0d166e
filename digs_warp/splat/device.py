"""Gaussians and image planes as Warp arrays: what the kernels read and write."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.gaussians import Gaussians
from digs_warp.splat.config import IMAGE_PADDING, TILE_SIZE


@dataclass
class DeviceGaussians:
    """Raw parameters of `digs_warp.gaussians.Gaussians` on a device; also used for their gradients."""

    means: wp.array  # [n] vec3
    log_scales: wp.array  # [n] vec3
    quats: wp.array  # [n] vec4, xyzw
    opacity_logits: wp.array  # [n]
    sh: wp.array  # [n, K] vec3

    def __len__(self) -> int:
        return self.means.shape[0]

    @property
    def arrays(self) -> tuple[wp.array, wp.array, wp.array, wp.array, wp.array]:
        """All five, in the order of the fields."""
        return self.means, self.log_scales, self.quats, self.opacity_logits, self.sh

    @property
    def device(self) -> str:
        """The Warp device they live on."""
        return str(self.means.device)

    @staticmethod
    def from_numpy(gaussians: Gaussians, device: str = "cpu") -> "DeviceGaussians":
        """Copy Gaussians to a device."""

        def put(value: np.ndarray, dtype: type) -> wp.array:
            return wp.array(value, dtype=dtype, device=device)

        return DeviceGaussians(
            put(gaussians.means, wp.vec3),
            put(gaussians.log_scales, wp.vec3),
            put(gaussians.quats, wp.vec4),
            put(gaussians.opacity_logits, wp.float32),
            put(gaussians.sh, wp.vec3),
        )

    def to_numpy(self) -> Gaussians:
        """Return a copy on the host."""
        return Gaussians(*(array.numpy().copy() for array in self.arrays))

    def zeros_like(self) -> "DeviceGaussians":
        """Return the same arrays, filled with zeros."""
        return DeviceGaussians(*(wp.zeros_like(array) for array in self.arrays))


class ImagePlanes:
    """``channels`` float32 planes of one size with a border of zeros, in one flat Warp array.

    Pixel (x, y) of channel c lies at ``origin + c * plane + y * pitch + x``. Kernels never write the
    border, so windows that reach over the image edge read zeros.
    """

    def __init__(self, width: int, height: int, channels: int, device: str = "cpu") -> None:
        self.width = width
        self.height = height
        self.channels = channels
        self.pitch = -(-width // TILE_SIZE) * TILE_SIZE + 2 * IMAGE_PADDING
        rows = -(-height // TILE_SIZE) * TILE_SIZE + 2 * IMAGE_PADDING
        self.plane = self.pitch * rows
        self.origin = IMAGE_PADDING * self.pitch + IMAGE_PADDING
        self.data = wp.zeros(self.plane * channels, dtype=float, device=device)

    def assign(self, pixels: np.ndarray) -> None:
        """Fill from pixels, shape (height, width, channels) or (height, width)."""
        padded = np.zeros((self.channels, self.plane // self.pitch, self.pitch), dtype=np.float32)
        pixels = np.atleast_3d(pixels).transpose(2, 0, 1)
        inside = slice(IMAGE_PADDING, None)
        padded[:, inside, inside][:, : self.height, : self.width] = pixels
        self.data.assign(padded.reshape(-1))

    def to_numpy(self) -> np.ndarray:
        """Return a copy of the pixels, shape (height, width, channels), float32."""
        padded = self.data.numpy().reshape(self.channels, -1, self.pitch)
        p = IMAGE_PADDING
        inside = padded[:, p : p + self.height, p : p + self.width]
        return np.ascontiguousarray(inside.transpose(1, 2, 0))
