"""Disparity noise: smooth from pixel to pixel, in part new in every frame, in part tied to the texture."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from sim.rig import StereoRig
from sim.sensor.effects.protocol import Choice, choose_above
from sim.sensor.facts import SceneFacts
from sim.sensor.filters import blur, box_mean, enlarge, shrink
from sim.sensor.frame import FrameTruth, Sensed
from sim.sensor.noise_field import smooth_normal

# The texture's share follows the grey values in a band: details finer than the noise's own correlation
# and shading coarser than twice that carry none of it.
BAND_RATIO = 2.0

# Region over which the band is brought to variance 1, in correlation lengths.
REGION = 8

# Grey-level noise below which a band is no texture [DN].
NO_TEXTURE = 0.5

# The texture's part is bounded: interpolation between pixels cannot err without limit.
LARGEST = 3.0


@dataclass(frozen=True)
class CorrelatedNoise:
    """Noise with the standard deviation and correlation length of the rig.

    Semi-global matching errs in patches of about its window (1/e at 4 px for windows of 3 to 5, 6 px for
    9), and half of its error stays while camera and scene stand still: it comes from interpolating the
    texture, not from image noise. White noise is wrong in kind.
    """

    name: ClassVar[str] = "correlated-noise"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """Switch on for every rig that has noise."""
        return choose_above(
            self.name,
            "disparity_sigma",
            rig.disparity_sigma,
            0.0,
            "px",
            on="no matcher is exact, on any surface",
            off="the rig has no noise",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Add noise to the disparity; ``strength`` is a factor on its standard deviation."""
        rig = truth.rig
        sigma = strength * rig.disparity_sigma
        noise = smooth_normal(rng, truth.depth.shape, rig.noise_correlation)
        noise *= np.float32(sigma * np.sqrt(rig.temporal_share))
        if rig.temporal_share < 1:
            fixed = texture_pattern(truth.gray, rig.noise_correlation)
            fixed *= np.float32(sigma * np.sqrt(1 - rig.temporal_share))
            noise += fixed
        return sensed.shifted(noise)


def texture_pattern(gray: np.ndarray, correlation: float) -> np.ndarray:
    """Return a pattern of mean 0 and variance 1 that goes with the texture, (height, width), float32.

    It moves with the surface and does not change between frames; where there is no texture, it fades.

    Args:
        gray: left image, (height, width), uint8.
        correlation: over which it is smooth [px].
    """
    fine = blur(gray, 0.5 * correlation)
    # Twice as coarse, and a quarter of the work, on a grid of half the size.
    half = shrink(fine, 2)
    band = fine
    band -= enlarge(blur(half, 0.5 * BAND_RATIO * 0.5 * correlation), gray.shape)
    energy = box_mean(shrink(np.square(band), 4), int(REGION * correlation / 4) | 1)
    scale = 1 / np.sqrt(np.maximum(energy, np.float32(0)) + np.float32(NO_TEXTURE**2))
    band *= enlarge(scale, gray.shape)
    return np.clip(band, -LARGEST, LARGEST, out=band)
