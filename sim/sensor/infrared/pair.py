"""The images of an infrared pair: the brightness of the scene, and the dots of the projector on it.

The renderer knows the scene in three visible colors. Infrared light is reflected otherwise (cloth and plants
are mostly brighter, prints are paler), and no mesh says how: luminance stands for it.
"""

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.color.adaptation import LUMINANCE
from digs_warp.sim.sensor.color.encoding import decode, encode
from digs_warp.sim.sensor.color.image_noise import noise_sigma

# Plain walls get no depth from dots that are weaker than this many standard deviations of the image noise
# [measured: on the gray box of the sample pair of a D435].
STANDS_OUT = 3.0


def infrared_image(image: np.ndarray) -> np.ndarray:
    """Return the brightness of a rendered image in three equal channels, (height, width, 3), uint8."""
    return in_three_channels(encode(decode(image) @ LUMINANCE))


def with_dots(infrared: np.ndarray, dots: np.ndarray) -> np.ndarray:
    """Return an infrared image with the light of the projector.

    Args:
        infrared: (height, width, 3), uint8, equal channels.
        dots: linear, 1 is white, (height, width), float32.
    """
    return in_three_channels(encode(decode(infrared[..., 0]) + dots))


def stands_out(infrared: np.ndarray, peak: np.ndarray, rig: StereoRig) -> np.ndarray:
    """Return where the center of a dot is brighter than its surroundings by STANDS_OUT times the image noise.

    Rounding to eight bits is noise, too. Light beyond white does not show.

    Args:
        infrared: without dots, (height, width, 3), uint8, equal channels.
        peak: light of the center of a mean dot at each pixel, linear, (height, width), float32.
        rig: its noise.

    Returns:
        (height, width), bool.
    """
    gray = infrared[..., 0]
    light = decode(gray)
    step = decode(np.minimum(gray, 254) + np.uint8(1)) - decode(np.minimum(gray, 254))
    noise = np.hypot(noise_sigma(light, rig), step / np.sqrt(12))
    return np.minimum(peak, 1 - light) > STANDS_OUT * noise


def in_three_channels(gray: np.ndarray) -> np.ndarray:
    """Return a gray image, (height, width), as the effects on images expect it, (height, width, 3)."""
    return np.repeat(gray[..., None], 3, axis=2)


def one_channel(image: np.ndarray) -> np.ndarray:
    """Return the gray image, (height, width), that the effects on images made of one with equal channels.

    Noise differs between the channels: an infrared eye has one.
    """
    return np.ascontiguousarray(image[..., 0])
