"""Read noise: the sensor's electronics add the same noise to every pixel; it shows in the dark."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.color.noise_law import STEPS_PER_LINEAR, read_sigma
from digs_warp.sim.sensor.color.protocol import EyeImages
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.noise_field import white_normal


@dataclass(frozen=True)
class ReadNoise:
    """Adds noise of one variance, per pixel, channel and eye."""

    name: ClassVar[str] = "read-noise"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """It depends on the sensor alone."""
        return choose_above(
            self.name,
            "read_noise",
            read_sigma(rig) * STEPS_PER_LINEAR,
            0.0,
            "DN",
            on="the electronics add noise of their own, which shows in the dark",
            off="shot noise explains all image noise that the profile states",
        )

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Add white Gaussian noise in linear light."""
        sigma = np.float32(strength * read_sigma(rig))
        return eyes.with_images(*(_noisy(image, sigma, rng) for image in (eyes.left, eyes.right)))


def _noisy(linear: np.ndarray, sigma: np.float32, rng: np.random.Generator) -> np.ndarray:
    noise = white_normal(rng, linear.shape)
    noise *= sigma
    noise += linear
    return noise
