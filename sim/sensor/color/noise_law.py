"""The law of image noise: light comes in photons, and the amplifier adds its own.

In linear light (1 is white) the variance of a pixel is

    x / W + r

with x the signal and W the electrons that a white pixel holds: x / W is shot noise (photons are counted:
Poisson), r is read noise. A rig states W and the standard deviation at middle grey in 8-bit sRGB steps,
as one reads it off recorded images; r is what W leaves of it.
"""

import numpy as np

from digs_warp.sim.rig import StereoRig

MIDDLE_GREY = 0.18  # linear

# 8-bit sRGB steps per unit of linear light at middle grey: the derivative of the sRGB curve there.
STEPS_PER_LINEAR = 255 * 1.055 / 2.4 * MIDDLE_GREY ** (1 / 2.4 - 1)


def shot_factor(rig: StereoRig) -> float:
    """Return the standard deviation of shot noise at white; it falls with the root of the signal.

    It never exceeds the noise that the rig states at middle grey.
    """
    stated = rig.image_noise / STEPS_PER_LINEAR / np.sqrt(MIDDLE_GREY)
    return float(min(1 / np.sqrt(rig.full_well), stated))


def read_sigma(rig: StereoRig) -> float:
    """Return the standard deviation of read noise, in linear light."""
    total = (rig.image_noise / STEPS_PER_LINEAR) ** 2
    return float(np.sqrt(max(total - shot_factor(rig) ** 2 * MIDDLE_GREY, 0.0)))
