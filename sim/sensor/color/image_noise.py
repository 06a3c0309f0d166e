"""Image noise: photons arrive at random (shot noise), and the electronics add their own (read noise).

In linear light (1 is white) the variance of a pixel is

    x / W + r

where x is the signal and W the number of electrons that a white pixel holds. x / W is shot noise (photon
counts are Poisson distributed), r is read noise, which shows in the dark. A rig states W and the standard
deviation at middle gray in 8-bit sRGB steps, which can be read off recorded images; r is the remainder.

A longer exposure collects more electrons, so the law holds for its brighter image, too. An electronic gain g
multiplies what is there: the image x after the gain has the variance

    g x / W + g^2 r
"""

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.color.adaptation import MIDDLE_GREY
from digs_warp.sim.sensor.color.encoding import along_a_row
from digs_warp.sim.sensor.color.protocol import EyeImages, PixelEffect
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.noise_field import white_normal

# 8-bit sRGB steps per unit of linear light at middle gray: the derivative of the sRGB curve there.
STEPS_PER_LINEAR = 255 * 1.055 / 2.4 * MIDDLE_GREY ** (1 / 2.4 - 1)


def shot_factor(rig: StereoRig) -> float:
    """Return the standard deviation of shot noise at white; it grows with the square root of the signal.

    It never exceeds the noise that the rig states at middle gray.
    """
    stated = rig.image_noise / STEPS_PER_LINEAR / np.sqrt(MIDDLE_GREY)
    return float(min(1 / np.sqrt(rig.full_well), stated))


def read_sigma(rig: StereoRig) -> float:
    """Return the standard deviation of read noise, in linear light."""
    total = (rig.image_noise / STEPS_PER_LINEAR) ** 2
    return float(np.sqrt(max(total - shot_factor(rig) ** 2 * MIDDLE_GREY, 0.0)))


def noise_sigma(linear: np.ndarray, rig: StereoRig) -> np.ndarray:
    """Return the standard deviation of both kinds of noise at pixels of that brightness, in linear light."""
    return np.sqrt(shot_factor(rig) ** 2 * np.maximum(linear, 0) + read_sigma(rig) ** 2)


class ShotNoise(PixelEffect):
    """Shot noise: its variance is proportional to the signal, per pixel, channel and eye."""

    name = "shot-noise"
    statistic = "image_noise"
    unit = "DN"
    cost = 45.0
    on = "light comes in photons, and every sensor counts them"
    off = "the profile states no image noise"

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Add Gaussian noise: at hundreds of photons a Poisson distribution looks the same."""
        return _noisy(eyes, strength * shot_factor(rig), rng, is_shot=True)


class ReadNoise(PixelEffect):
    """Read noise: its variance is constant, per pixel, channel and eye."""

    name = "read-noise"
    statistic = "read_noise"
    unit = "DN"
    cost = 25.0
    on = "the electronics add noise, which shows in the dark"
    off = "shot noise explains all image noise that the profile states"

    def measured(self, facts: SceneFacts, rig: StereoRig) -> float:
        """Return its standard deviation at middle gray."""
        return read_sigma(rig) * STEPS_PER_LINEAR

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Add white Gaussian noise in linear light."""
        return _noisy(eyes, strength * read_sigma(rig), rng, is_shot=False)


def _noisy(eyes: EyeImages, sigma: float, rng: np.random.Generator, is_shot: bool) -> EyeImages:
    """Return the eyes plus white noise of standard deviation ``sigma``; of shot noise, at white."""
    power = 0.5 if is_shot else 1.0
    red, green, blue = (sigma * gain**power for gain in eyes.electronic_gain)
    sigmas = along_a_row((red, green, blue), eyes.left)
    noisy = []
    for image in (eyes.left, eyes.right):
        noise = white_normal(rng, image.shape)
        noise *= sigmas
        if is_shot:
            light = np.maximum(image, 0)
            noise *= np.sqrt(light, out=light)
        noise += image
        noisy.append(noise)
    return eyes.with_images(*noisy)
