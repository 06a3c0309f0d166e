"""Disparity noise: smooth over pixels; one part changes with every frame, one belongs to the texture."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.filters import (
    DOUBLED_KERNEL,
    DOUBLED_VARIANCE,
    HALVED_VARIANCE,
    blur,
    box_mean,
    doubled,
    halved,
    separable,
)
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.noise_field import smooth_normal

# The part that belongs to the texture follows the gray values in a band of scales: details finer than the
# noise's correlation length and shading coarser than twice that length do not count.
BAND_RATIO = 2.0

# At this correlation length and above, noise is drawn on a grid of half the size [px]: a quarter of the work.
HALF_GRID_FROM = 4.0

# Evens out the difference between pixels on that grid and between its points, which would show as a moving
# pattern; its variance in pixels of the grid.
EVEN_KERNEL = np.array([1, 2, 1]) / 4
EVEN_VARIANCE = 1 / 8

# `doubled` and EVEN_KERNEL together, at the grid's own pixels.
SEEN_KERNEL = np.array([3, 10, 3]) / 16

# Region over which the band is normalized to variance 1, in correlation lengths.
REGION = 8

# Contrast below which a band is not texture [DN].
NO_TEXTURE = 0.5

# Limit of the texture's part: the error of interpolation between pixels is bounded.
LARGEST = 3.0


@dataclass(frozen=True)
class CorrelatedNoise:
    """Noise with the standard deviation and correlation length of the rig.

    The errors of semi-global matching are correlated over about its window (1/e at 4 px for windows of 3 to
    5, at 6 px for 9). Half of the error stays the same while camera and scene stand still: it comes from
    interpolating the texture, not from image noise. White noise would be the wrong kind of error.
    """

    name: ClassVar[str] = "correlated-noise"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On for every rig with noise."""
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
        noise = temporal_noise(rng, truth.depth.shape, rig.noise_correlation)
        noise *= np.float32(sigma * np.sqrt(rig.temporal_share))
        if rig.temporal_share < 1:
            fixed = texture_pattern(truth.gray, rig.noise_correlation)
            fixed *= np.float32(sigma * np.sqrt(1 - rig.temporal_share))
            noise += fixed
        return sensed.shifted(noise)


def temporal_noise(
    rng: np.random.Generator, shape: tuple[int, int], correlation: float
) -> np.ndarray:
    """Return a normal field of variance 1, new in every frame, (height, width), float32.

    Args:
        rng: draws the field.
        shape: (height, width).
        correlation: over which it is smooth [px], >= 2.
    """
    if correlation < HALF_GRID_FROM:
        return smooth_normal(rng, shape, correlation)
    half = 2 * np.sqrt(np.square(0.25 * correlation) - DOUBLED_VARIANCE)
    field = smooth_normal(rng, (-(-shape[0] // 2), -(-shape[1] // 2)), half)
    field /= np.float32(_share_left(half))
    return doubled(field, shape)


def _share_left(correlation: float) -> float:
    """Return the share of a field's variance that `doubled` keeps along one axis.

    The mean of two cases that differ by 1.5 %: between two pixels, `doubled` takes their mean; at a pixel, it
    applies `DOUBLED_KERNEL`.

    Args:
        correlation: length at which the correlation, a Gaussian, is 1/e [px of the smaller image].
    """
    next_one, second = np.exp(-np.square(np.array([1.0, 2.0]) / correlation))
    side, middle, _ = DOUBLED_KERNEL
    at = middle**2 + 2 * side**2 + 4 * side * middle * next_one + 2 * side**2 * second
    return float(0.5 * at + 0.25 * (1 + next_one))


def texture_pattern(gray: np.ndarray, correlation: float) -> np.ndarray:
    """Return a pattern of mean 0 and variance 1 that belongs to the texture, (height, width), float32.

    It moves with the surface and does not change between frames; without texture, it fades out.

    Args:
        gray: left image, (height, width), uint8.
        correlation: over which it is smooth [px], >= 2.
    """
    if correlation < HALF_GRID_FROM:
        smooth = blur(gray, 0.5 * correlation)
        band = smooth - blur(smooth, BAND_RATIO * 0.5 * correlation)
        pattern = band / _contrast(band, correlation)
    else:
        sigma = 0.25 * correlation  # in pixels of the grid
        done = HALVED_VARIANCE + DOUBLED_VARIANCE + EVEN_VARIANCE
        smooth = blur(halved(gray), np.sqrt(sigma**2 - done))
        band = smooth - blur(smooth, BAND_RATIO * sigma)
        seen = separable(band, SEEN_KERNEL, SEEN_KERNEL, 0.0)
        band /= _contrast(seen, 0.5 * correlation)
        pattern = separable(doubled(band, gray.shape), EVEN_KERNEL, EVEN_KERNEL, 0.0)
    return np.clip(pattern, -LARGEST, LARGEST, out=pattern)


def _contrast(band: np.ndarray, correlation: float) -> np.ndarray:
    """Return the standard deviation of ``band`` in the region around each pixel, noise included."""
    energy = box_mean(np.square(band), int(REGION * correlation) | 1)
    return np.sqrt(np.maximum(energy, np.float32(0)) + np.float32(NO_TEXTURE**2))
