"""Shot noise: photons arrive at random, so the noise grows with the square root of the light."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.color.noise_law import shot_factor
from digs_warp.sim.sensor.color.protocol import EyeImages
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.noise_field import white_normal


@dataclass(frozen=True)
class ShotNoise:
    """Adds noise with a variance proportional to the signal, per pixel, channel and eye."""

    name: ClassVar[str] = "shot-noise"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """It depends on the sensor alone."""
        return choose_above(
            self.name,
            "image_noise",
            rig.image_noise,
            0.0,
            "DN",
            on="light comes in photons, and every sensor counts them",
            off="the profile states no image noise",
        )

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Add Gaussian noise: at hundreds of photons a Poisson distribution looks the same."""
        factor = np.float32(strength * shot_factor(rig))
        return eyes.with_images(*(_noisy(image, factor, rng) for image in (eyes.left, eyes.right)))


def _noisy(linear: np.ndarray, factor: np.float32, rng: np.random.Generator) -> np.ndarray:
    noise = white_normal(rng, linear.shape)
    noise *= factor * np.sqrt(np.maximum(linear, 0))
    noise += linear
    return noise
