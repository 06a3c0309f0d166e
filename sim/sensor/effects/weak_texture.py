"""Weak texture: image noise shows in the disparity, and at last drowns the match."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from sim.rig import StereoRig
from sim.sensor.cause import Cause
from sim.sensor.effects.protocol import Choice, choose_above
from sim.sensor.facts import SceneFacts
from sim.sensor.filters import box_mean, enlarge
from sim.sensor.frame import FrameTruth, Sensed
from sim.sensor.noise_field import patchy_uniform, smooth_normal
from sim.sensor.texture import noise_of

# Temporal disparity error of semi-global matching: c sqrt(2) / (w SNR) px for a window of w pixels and
# SNR = gradient / image noise; c was between 0.34 and 0.6.
ERROR_PER_SNR = 0.47 * np.sqrt(2)
LARGEST_ERROR = 1.0  # [px]; beyond it, pixels are lost instead

# In weak texture noise is smooth over more pixels: 10 along rows, 5 along columns were seen, not 4.
CORRELATION_GAIN = (1.25, 2.5)  # columns, rows

# SNR is that of a region: semi-global matching gathers evidence beyond its window [windows].
REGION = 4

# Share of matched pixels by SNR where the texture is weak all round.
SNRS = (0.0, 0.06, 0.12, 0.24, 0.47)
FILL = (0.0, 0.003, 0.09, 0.99, 1.0)

# "All round": a plain patch smaller than this is filled from its rim [px].
SURROUNDINGS = 161
STRIDE = 8  # such means do not need every pixel

# Share of the surface with an SNR below 0.5 from which the effect shows.
MIN_SHARE = 0.01


@dataclass(frozen=True)
class WeakTexture:
    """More noise where the gradient is close to the image noise, holes where it drowns in it."""

    name: ClassVar[str] = "weak-texture"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """Switch on when part of the surface is weakly textured."""
        return choose_above(
            self.name,
            "weak_texture_share",
            facts.weak_texture_share,
            MIN_SHARE,
            "",
            on="parts of the surface have so little texture that image noise spoils the match",
            off="the texture stands out from the image noise everywhere",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Add noise and holes; ``strength`` is a factor on the image noise."""
        rig, shape = truth.rig, truth.depth.shape
        energy = np.square(truth.gradient)
        noise = np.float32(strength * noise_of(rig.image_noise))
        region = np.maximum(box_mean(energy, REGION * rig.window | 1), np.float32(1e-6))
        variance = np.minimum((ERROR_PER_SNR / rig.window * noise) ** 2 / region, LARGEST_ERROR**2)
        # Excess over the noise of good texture, which has an effect of its own.
        variance -= np.float32(rig.disparity_sigma**2 * rig.temporal_share)
        excess = _root(variance)
        vertical, horizontal = (gain * rig.noise_correlation for gain in CORRELATION_GAIN)
        field = smooth_normal(rng, shape, horizontal, vertical)
        excess *= field
        sensed = sensed.shifted(excess)

        coarse = box_mean(
            np.ascontiguousarray(energy[::STRIDE, ::STRIDE]), SURROUNDINGS // STRIDE | 1
        )
        fill = np.interp(_root(coarse) / noise, SNRS, FILL).astype(np.float32)
        if (fill == 1).all():
            return sensed
        lost = patchy_uniform(rng, shape, 2 * rig.noise_correlation) > enlarge(fill, shape)
        return sensed.with_holes(lost, Cause.WEAK_TEXTURE)


def _root(values: np.ndarray) -> np.ndarray:
    # Running sums and differences leave tiny negative numbers where there should be 0.
    return np.sqrt(np.maximum(values, 0.0))
