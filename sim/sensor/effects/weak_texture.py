"""Weak texture: image noise shows in the disparity, and at last drowns the match."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.effects.weak_texture_kernel import WeakTextureFields, apply_weak_texture
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.filters import box_mean
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.noise_field import level_above, normal_rows
from digs_warp.sim.sensor.row_field import interpolated
from digs_warp.sim.sensor.tables import LogTable
from digs_warp.sim.sensor.texture import BLOCK, noise_of

# Disparity error [px] by typical gradient / image noise: semi-global matching (window 5, image noise 2 DN)
# of rendered scenes, between a brick wall (0.75 times as much) and a blurred photograph (1.3 times). The
# typical gradient is the geometric mean over a region: a few strong edges do not help the plain ground.
SNRS = (0.05, 0.09, 0.18, 0.37, 0.75, 1.5, 3.0, 6.0)
ERRORS = (1.10, 0.85, 0.57, 0.41, 0.29, 0.22, 0.16, 0.10)

# Beyond that, whole strips along the rows go wrong together, or are lost: semi-global matching carries a
# disparity from pixel to pixel. Share of the pixels by SNR that are wrong beyond what such noise explains,
# and of holes, in the recorded images of four meshes; seven in ten of all wrong pixels read too far.
STRIP_SNRS = (0.05, 0.09, 0.12, 0.18, 0.37, 0.75, 1.5, 2.2)
STRIP_WRONG = (0.30, 0.18, 0.12, 0.075, 0.05, 0.047, 0.005, 0.0)
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

# Mean square gradient below which nothing is there to match [DN^2/px^2].
TINY = np.float32(1e-6)

# Share of the surface with an SNR below 0.5 from which the effect shows.
MIN_SHARE = 0.01

# The curves above over ln(SNR).
_ERROR = LogTable(SNRS, ERRORS)
_WRONG = LogTable(STRIP_SNRS, STRIP_WRONG)
_LOST = LogTable(STRIP_SNRS, STRIP_LOST)
_FILL = LogTable(FILL_SNRS, FILL)


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
        noise = strength * noise_of(rig.image_noise)
        snr = truth.texture.typical(REGION * rig.window) - np.float32(np.log(noise))
        surroundings = box_mean(truth.texture.energies, SURROUNDINGS // BLOCK | 1)
        # Running sums leave tiny negative means in flat regions.
        energy = np.log(np.maximum(surroundings, TINY)) - np.float32(2 * np.log(noise))
        vertical, horizontal = (gain * rig.noise_correlation for gain in CORRELATION_GAIN)
        maps = (_excess_noise(snr, rig), *_strip_levels(snr), _patch_level(energy))
        sigma, wrong, lost, patch = (interpolated(grid, BLOCK, shape) for grid in maps)
        fields = WeakTextureFields(
            noise=normal_rows(rng, shape, horizontal, vertical),
            sigma=sigma,
            strips=normal_rows(rng, shape, *STRIP_LENGTHS),
            wrong_level=wrong,
            lost_level=lost,
            patches=normal_rows(rng, shape, 2 * rig.noise_correlation),
            patch_level=patch,
        )
        changed = sensed.changeable()
        frame = (changed.disparity, changed.cause, changed.confidence)
        apply_weak_texture(*frame, fields, STRIP_ERROR, STRIP_GROWTH, WRONG)
        return replace(changed, owned=sensed.owned)


def _strip_levels(snr: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the levels above which a normal field is wrong, and is lost, for ln(SNR)."""
    # What is lost in a small plain patch is filled from its rim.
    wider = box_mean(snr, STRIP_SURROUNDINGS // BLOCK | 1)
    lost = _LOST.at(wider)
    wrong = lost + (1 - lost) * _WRONG.at(snr)
    return level_above(wrong), level_above(lost)


def _patch_level(energy: np.ndarray) -> np.ndarray:
    """Return the level above which a normal field is lost, for 2 ln(SNR) all round."""
    return level_above(1 - _FILL.at(np.float32(0.5) * energy))


def _excess_noise(snr: np.ndarray, rig: StereoRig) -> np.ndarray:
    """Return the error that good texture would not have [px], for ln(SNR), float32."""
    excess = np.square(_ERROR.at(snr))
    excess -= np.float32(rig.disparity_sigma**2 * rig.temporal_share)
    return np.sqrt(np.maximum(excess, 0, out=excess), out=excess)
