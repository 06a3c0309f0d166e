"""How well a patch can be matched: its horizontal gradient against the noise of the image.

Stereo matching compares along rows, so only gradients along x carry information. Thresholds are from
experiments with semi-global matching (OpenCV StereoSGBM, window 5) on textures of known contrast.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.sim.sensor.arrays import launch_rows, shared
from digs_warp.sim.sensor.filters import box_mean, distance_to
from digs_warp.sim.sensor.texture_kernel import BLOCK, PIECE, texture_kernel

# Gradient over image noise from which a patch is matched: 99 % of the pixels are at 0.24, 9 % at 0.12.
MATCHABLE_SNR = 0.25

# Noise of the luma per noise of a channel: the root of the sum of the squared weights (Rec. 601).
LUMA_NOISE = float(np.hypot(np.hypot(0.299, 0.587), 0.114))

# Steps of 8-bit images; no patch is less noisy than rounding.
ROUNDING_NOISE = 1 / np.sqrt(12)


@dataclass(frozen=True, eq=False)
class Texture:
    """How much the grey values change along the rows.

    Attributes:
        gradient: RMS in the matching window [DN/px], (height, width), float32.
        logarithms: mean of ln(gradient + LEAST_GRADIENT) of single pixels, one for each BLOCK x BLOCK
            pixels; the last block of a row or column may have fewer. float32.
        energies: mean square of ``gradient``, in the same blocks [DN^2/px^2], float32.
    """

    gradient: np.ndarray
    logarithms: np.ndarray
    energies: np.ndarray

    def typical(self, size: int) -> np.ndarray:
        """Return the logarithm of the typical gradient of regions of ``size`` pixels, one for each block.

        The geometric mean is what is typical: a few strong edges do not help the plain ground.
        """
        return box_mean(self.logarithms, size // BLOCK | 1)


def measure_texture(gray: np.ndarray, window: int) -> Texture:
    """Return the texture of an image.

    Gradients are central differences, mirrored at the borders; windows repeat the border.

    Args:
        gray: (height, width), uint8.
        window: width of the matching window [px], odd.
    """
    height, width = gray.shape
    blocks = (-(-height // BLOCK), -(-width // BLOCK))
    pitch = width + window + 2 * PIECE
    gradient = wp.empty(height * width, dtype=float, device="cpu")
    logarithms, energies = (
        wp.empty(blocks[0] * blocks[1], dtype=float, device="cpu") for _ in range(2)
    )
    scratch = wp.empty(blocks[0] * 4 * pitch, dtype=float, device="cpu")
    inputs = [shared(gray), height, width, window, pitch, scratch, gradient, logarithms, energies]
    launch_rows(texture_kernel, blocks[0], inputs)
    return Texture(
        gradient.numpy().reshape(height, width),
        logarithms.numpy().reshape(blocks),
        energies.numpy().reshape(blocks),
    )


def noise_of(image_noise: float) -> float:
    """Return the noise of the luma that is matched, which a gradient must beat [DN].

    Args:
        image_noise: of each colour channel [DN]; the channels' noise is independent.
    """
    return max(LUMA_NOISE * image_noise, ROUNDING_NOISE)


def texture_distance(snr: np.ndarray) -> np.ndarray:
    """Return how far each pixel is from a matchable one [px], float32, inf where there is none."""
    return distance_to(snr > MATCHABLE_SNR)
