"""Weak texture: image noise shows in the disparity, and at last drowns the match."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sim.rig import StereoRig
from sim.sensor.cause import Cause
from sim.sensor.effects.protocol import Choice, choose_above
from sim.sensor.facts import SceneFacts
from sim.sensor.filters import box_mean, enlarge, shrink
from sim.sensor.frame import FrameTruth, Sensed
from sim.sensor.noise_field import patchy_uniform, smooth_normal
from sim.sensor.texture import noise_of, typical_gradient

# Disparity error [px] by typical gradient / image noise: semi-global matching (window 5, image noise 2 DN)
# of rendered scenes, between a brick wall (0.75 times as much) and a blurred photograph (1.3 times). The
# typical gradient is the geometric mean over a region: a few strong edges do not help the plain ground.
SNRS = (0.05, 0.09, 0.18, 0.37, 0.75, 1.5, 3.0, 6.0)
ERRORS = (1.10, 0.85, 0.57, 0.41, 0.29, 0.22, 0.16, 0.10)

# Beyond that, whole strips along the rows go wrong together, or are lost: semi-global matching carries a
# disparity from pixel to pixel. Share of the pixels by SNR that are wrong beyond what such noise explains,
# and of holes, in the recorded images of four meshes; seven in ten of all wrong pixels read too far.
STRIP_SNRS = (0.05, 0.09, 0.12, 0.18, 0.37, 0.75, 1.5, 2.2)
STRIP_WRONG = (0.30, 0.24, 0.14, 0.075, 0.05, 0.047, 0.005, 0.0)
STRIP_LOST = (0.60, 0.45, 0.05, 0.005, 0.0, 0.0, 0.0, 0.0)

# Correlation length of the strips along rows and columns [px]. The wrong pixels of the matcher are still
# correlated by 0.2 at 32 px along rows, by 0.1 along columns.
STRIP_LENGTHS = (48.0, 5.0)

# Holes need weak texture over this many pixels.
STRIP_SURROUNDINGS = 81

# Half of the wrong pixels are off by more than 1.4 px, one in ten by more than 2.5 px: error at the rim of a
# strip [px], and its growth per unit of the field of which the strips are the peaks.
STRIP_ERROR, STRIP_GROWTH = 1.05, 1.6

# Errors above this have a label [px].
WRONG = 1.0

# In weak texture noise is smooth over more pixels: 10 along rows, 5 along columns were seen, not 4.
CORRELATION_GAIN = (1.25, 2.5)  # columns, rows

# SNR is that of a region: semi-global matching gathers evidence beyond its window [windows].
REGION = 4

# Share of matched pixels by SNR where the texture is weak all round.
FILL_SNRS = (0.0, 0.06, 0.12, 0.24, 0.47)
FILL = (0.0, 0.003, 0.09, 0.99, 1.0)

# "All round": a plain patch smaller than this is filled from its rim [px].
SURROUNDINGS = 161

# Regional means are computed on blocks of this many pixels.
STRIDE = 4

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
        energy = shrink(np.square(truth.gradient), STRIDE)
        noise = strength * noise_of(rig.image_noise)
        typical = typical_gradient(truth.gray, REGION * rig.window, STRIDE) / noise
        vertical, horizontal = (gain * rig.noise_correlation for gain in CORRELATION_GAIN)
        error = smooth_normal(rng, shape, horizontal, vertical)
        error *= enlarge(_excess_noise(typical, rig), shape)
        before = sensed.disparity
        shifted = before + error
        wrong = (np.abs(error) > np.float32(WRONG)) & sensed.known
        sensed = replace(sensed, disparity=shifted)
        sensed = sensed.with_values(wrong, shifted, Cause.WEAK_TEXTURE, confidence=0.5)
        sensed = _with_strips(sensed, before, typical, rng)

        fill = np.interp(_regional_root(energy, SURROUNDINGS) / noise, FILL_SNRS, FILL)
        if fill.min() == 1:
            return sensed
        fill = enlarge(fill.astype(np.float32), shape)
        lost = patchy_uniform(rng, shape, 2 * rig.noise_correlation) > fill
        return sensed.with_holes(lost, Cause.WEAK_TEXTURE)


def _with_strips(
    sensed: Sensed, before: np.ndarray, snr: np.ndarray, rng: np.random.Generator
) -> Sensed:
    """Return the frame with strips along the rows that are lost or read too far.

    Args:
        sensed: so far.
        before: disparity without the noise that the strips replace [px], (height, width).
        snr: typical gradient over image noise, on a coarse grid.
        rng: draws the strips.
    """
    from scipy.special import ndtri

    shape = sensed.disparity.shape
    # What is lost in a small plain patch is filled from its rim.
    wider = np.exp(box_mean(np.log(snr), STRIP_SURROUNDINGS // STRIDE | 1))
    lost = np.interp(wider, STRIP_SNRS, STRIP_LOST)
    wrong = lost + (1 - lost) * np.interp(snr, STRIP_SNRS, STRIP_WRONG)
    if wrong.max() == 0:
        return sensed
    # Levels above which a normal field has these shares; never reached where there are none.
    levels = (-ndtri(np.clip(share, 1e-9, 1.0)).astype(np.float32) for share in (wrong, lost))
    wrong_level, lost_level = (enlarge(level, shape).reshape(-1) for level in levels)
    across, down = STRIP_LENGTHS
    field = smooth_normal(rng, shape, across, down).reshape(-1)
    at = np.flatnonzero(field > wrong_level)
    excess = field[at] - wrong_level[at]
    value = before.reshape(-1)[at] - (STRIP_ERROR + STRIP_GROWTH * excess)
    gone = field[at] > lost_level[at]
    value[gone] = np.nan
    known = sensed.known.reshape(-1)[at]
    confidence = np.where(gone, np.float32(0.0), np.float32(0.5))
    return sensed.with_pixels(at[known], value[known], Cause.WEAK_TEXTURE, confidence[known])


def _excess_noise(snr: np.ndarray, rig: StereoRig) -> np.ndarray:
    """Return the error that good texture would not have [px], of the shape of ``snr``, float32."""
    excess = np.square(np.interp(snr, SNRS, ERRORS)) - rig.disparity_sigma**2 * rig.temporal_share
    return np.sqrt(np.maximum(excess, 0.0)).astype(np.float32)


def _regional_root(energy: np.ndarray, size: int) -> np.ndarray:
    """Return the RMS gradient over ``size`` pixels [DN/px]; energy comes in blocks of STRIDE pixels."""
    # Running sums leave tiny negative means in flat regions.
    return np.sqrt(np.maximum(box_mean(energy, size // STRIDE | 1), 0.0))
