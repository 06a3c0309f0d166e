"""Conversion between 8-bit sRGB and linear light by tables, and gains applied in linear light."""

from dataclasses import replace
from functools import cache

import numpy as np

from digs_warp.data.images import linear_from_srgb, srgb_from_linear, to_uint8
from digs_warp.sim.sensor.color.protocol import ByChannel, EyeImages
from digs_warp.sim.sensor.filters import table_values

CLIPPED = 0.995  # linear; the two highest 8-bit values: the true brightness there is lost


def amplified(eyes: EyeImages, gain: ByChannel, electronic: ByChannel) -> EyeImages:
    """Return both images with their channels multiplied by ``gain``, of which ``electronic`` is a part.

    Where images are clipped, white stays white, because its true brightness is unknown. The results are.
    """
    red, green, blue = (a * b for a, b in zip(eyes.electronic_gain, electronic, strict=True))
    clipped = CLIPPED if eyes.is_clipped else np.inf
    left, right = (_times_gain(image, gain, clipped) for image in (eyes.left, eyes.right))
    gains = (red, green, blue)
    return replace(eyes, left=left, right=right, electronic_gain=gains, is_clipped=True)


def along_a_row(factors: ByChannel, image: np.ndarray) -> np.ndarray:
    """Return ``factors`` for the pixels of a row, (width, channels), float32: four times as fast."""
    channels = factors if image.shape[2] > 1 else factors[1:2]  # white balance leaves green alone
    return np.tile(np.array(channels, np.float32), (image.shape[1], 1))


def _times_gain(linear: np.ndarray, gain: ByChannel, clipped: float) -> np.ndarray:
    """Return an image times a gain for each channel, at most 1; what is ``clipped`` or above stays."""
    brighter = linear * along_a_row(gain, linear)
    np.minimum(brighter, 1, out=brighter)
    if np.isfinite(clipped):
        np.copyto(brighter, linear, where=linear >= np.float32(clipped))
    return brighter


# Steps of linear light: sRGB is steepest in the dark, where one step is a twentieth of an 8-bit step.
LINEAR_STEPS = 65535


def decode(image: np.ndarray) -> np.ndarray:
    """Return sRGB pixels, uint8, as linear light, float32, 0 to 1."""
    return table_values(_decoding(), image)


def encode(linear: np.ndarray) -> np.ndarray:
    """Return linear light as sRGB pixels, uint8; values outside 0 to 1 are clipped."""
    steps = np.clip(np.asarray(linear, np.float32), 0, 1)
    steps *= LINEAR_STEPS
    steps += 0.5
    return _encoding().take(steps.astype(np.uint16))


@cache
def _decoding() -> np.ndarray:
    return linear_from_srgb(np.arange(256) / 255.0).astype(np.float32)


@cache
def _encoding() -> np.ndarray:
    return to_uint8(srgb_from_linear(np.arange(LINEAR_STEPS + 1) / LINEAR_STEPS))
