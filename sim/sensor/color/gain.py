"""Gains on the channels of both images, by a longer exposure or by the electronics."""

from dataclasses import replace

import numpy as np

from digs_warp.sim.sensor.color.protocol import ByChannel, EyeImages

CLIPPED = 0.995  # linear; the two highest 8-bit values: the true brightness there is lost


def amplified(eyes: EyeImages, gain: ByChannel, electronic: ByChannel) -> EyeImages:
    """Return both images with their channels multiplied by ``gain``, of which ``electronic`` is a part.

    Where images are clipped, white stays white, because its true brightness is unknown. The results are.
    """
    red, green, blue = (a * b for a, b in zip(eyes.electronic_gain, electronic, strict=True))
    left, right = (_amplified(image, gain, eyes.is_clipped) for image in (eyes.left, eyes.right))
    gains = (red, green, blue)
    return replace(eyes, left=left, right=right, electronic_gain=gains, is_clipped=True)


def times_channels(image: np.ndarray, factors: ByChannel) -> np.ndarray:
    """Return an image (height, width, 3), float32, times a factor for each channel."""
    height, width, _ = image.shape
    # A whole row at once is four times as fast as broadcasting over three channels.
    row = np.tile(np.array(factors, np.float32), width)
    return (image.reshape(height, -1) * row).reshape(image.shape)


def _amplified(linear: np.ndarray, gain: ByChannel, is_clipped: bool) -> np.ndarray:
    result = np.minimum(times_channels(linear, gain), np.float32(1))
    if is_clipped:
        np.copyto(result, linear, where=linear >= CLIPPED)
    return result
