"""Gains on the channels of both images, by a longer exposure or by the electronics."""

from dataclasses import replace

import numpy as np

from digs_warp.sim.sensor.color.pixel_loops import times_gain
from digs_warp.sim.sensor.color.protocol import ByChannel, EyeImages

CLIPPED = 0.995  # linear; the two highest 8-bit values: the true brightness there is lost


def amplified(eyes: EyeImages, gain: ByChannel, electronic: ByChannel) -> EyeImages:
    """Return both images with their channels multiplied by ``gain``, of which ``electronic`` is a part.

    Where images are clipped, white stays white, because its true brightness is unknown. The results are.
    """
    red, green, blue = (a * b for a, b in zip(eyes.electronic_gain, electronic, strict=True))
    clipped = CLIPPED if eyes.is_clipped else np.inf
    left, right = (times_gain(image, gain, clipped) for image in (eyes.left, eyes.right))
    gains = (red, green, blue)
    return replace(eyes, left=left, right=right, electronic_gain=gains, is_clipped=True)
