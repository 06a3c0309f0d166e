"""How well a patch can be matched: its horizontal gradient against the noise of the image.

Stereo matching compares along rows, so only gradients along x carry information. Thresholds are from
experiments with semi-global matching (OpenCV StereoSGBM, window 5) on textures of known contrast.
"""

import numpy as np

from digs_warp.sim.sensor.filters import box_mean, horizontal_gradient

# Gradient over image noise above which a patch is matched: 99 % of the pixels at 0.24, 9 % at 0.12.
MATCHABLE_SNR = 0.25

# Noise of the luma per noise of a channel: the root of the sum of squared weights (Rec. 601).
LUMA_NOISE = float(np.hypot(np.hypot(0.299, 0.587), 0.114))

# Rounding to 8 bits; no patch has less noise.
ROUNDING_NOISE = 1 / np.sqrt(12)


def gradient_in_window(gray: np.ndarray, window: int) -> np.ndarray:
    """Return the RMS of the horizontal gradient in the window round each pixel [DN/px], float32.

    Args:
        gray: (height, width), uint8.
        window: width of the matching window [px], odd.
    """
    return np.sqrt(box_mean(np.square(horizontal_gradient(gray)), window))


def noise_of(image_noise: float) -> float:
    """Return the noise of the luma, which a gradient must exceed to be matched [DN].

    Args:
        image_noise: of each color channel [DN]; the channels' noise is independent.
    """
    return max(LUMA_NOISE * image_noise, ROUNDING_NOISE)
