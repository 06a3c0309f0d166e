"""Grazing surfaces: the two eyes see a patch with different widths, and its texture does not match."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.coherent import coherent_uniform
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import GRAZING_RATIO, SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.slopes import slope_along_columns, steep_pixels, width_ratio

# Semi-global matching of slanted planes, window 5: 99, 75, 19 and 2 % of the pixels are matched at slopes
# along rows of 0.35, 0.40, 0.45 and 0.50, that is |ln(1 - slope)| = 0.43, 0.51, 0.60, 0.69: a logistic
# curve.
HALF_RATIO, RATIO_WIDTH = 0.548, 0.035
# Surfaces that are wider in the right eye match longer: 94 % at -0.8.
HALF_RATIO_WIDENING = 0.686
# A window of 9 fails 0.1 earlier.
RATIO_PER_WINDOW = 0.025
# Along columns: 82 % at 0.6, 7 % at 0.8.
HALF_SLOPE, SLOPE_WIDTH = 0.673, 0.049

# Below this slope, less than one pixel in 500 fails, for windows up to 9.
SAFE_SLOPE = 0.2


# Up to this distance, smoothness carries in the disparity of the matchable rim [px], and it is wrong: at
# the rims of round objects, in rendered scenes and a real pair, the matcher has a value for 70 to 90 % of
# the hopeless pixels, and 40 to 90 % of these are off by more than 1 px.
BRIDGE = 8

# A rim whose disparity differs by more than this per pixel of distance belongs to another surface.
SAME_SURFACE = 2.0

MIN_SHARE = 1e-3


@dataclass(frozen=True)
class Grazing:
    """Holes, and wrong depth in narrow strips, where one eye sees the texture strongly compressed."""

    name: ClassVar[str] = "grazing"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if part of the surface has |ln(1 - slope)| above 0.4."""
        return choose_above(
            self.name,
            f"share with width ratio above {GRAZING_RATIO}",
            facts.grazing_share,
            MIN_SHARE,
            "",
            on="some surfaces are so slanted that the eyes see them with different widths",
            off="no surface is slanted enough to look different to the two eyes",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Drop or bridge pixels; ``strength`` divides the slopes that can be matched."""
        at = steep_pixels(truth.disparity, truth.slope, SAFE_SLOPE / strength)
        if len(at) == 0:
            return sensed
        rows, columns = np.divmod(at, truth.depth.shape[1])
        x = truth.slope.reshape(-1)[at]
        y = np.abs(slope_along_columns(truth.disparity, rows, columns))
        half = np.where(x > 0, HALF_RATIO, HALF_RATIO_WIDENING)
        half -= RATIO_PER_WINDOW * (truth.rig.window - 5)
        excess = np.maximum(
            (strength * width_ratio(x) - half) / RATIO_WIDTH,
            (strength * y - HALF_SLOPE) / SLOPE_WIDTH,
        )
        shape = truth.depth.shape
        draw = coherent_uniform(rng, shape, rows, columns, truth.rig.noise_correlation)
        hopeless = np.zeros(shape, dtype=bool)
        hopeless.reshape(-1)[at] = excess > 0
        failed = draw < 1 / (1 + np.exp(-excess))
        return _bridged(sensed, at[failed], hopeless)


def _bridged(sensed: Sensed, failed: np.ndarray, hopeless: np.ndarray) -> Sensed:
    """Return the frame without the failed pixels, with the hopeless ones filled from the rim.

    Args:
        sensed: before.
        failed: flat indices of the pixels that are not matched, (n,).
        hopeless: surface on which most pixels fail, (height, width), bool.
    """
    known = failed[~np.isnan(sensed.disparity.reshape(-1)[failed])]
    values = np.full(len(known), np.nan, dtype=np.float32)
    bridged = hopeless.reshape(-1)[known]
    rows, columns = np.divmod(known[bridged], hopeless.shape[1])
    values[bridged] = _rim_values(sensed.disparity, hopeless, rows, columns)
    confidence = np.where(np.isnan(values), np.float32(0.0), np.float32(0.5))
    return sensed.with_pixels(known, values, Cause.GRAZING, confidence)


def _rim_values(
    disparity: np.ndarray, hopeless: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> np.ndarray:
    """Return the disparity of the nearest matchable pixel along rows or columns, (n,); NaN: too far."""
    height, width = hopeless.shape
    found = np.full(len(rows), np.nan, dtype=np.float32)
    for distance in range(1, BRIDGE + 1):
        for down, right in ((0, -1), (0, 1), (-1, 0), (1, 0)):
            row, column = rows + down * distance, columns + right * distance
            inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
            here = np.flatnonzero(inside & np.isnan(found))
            here = here[~hopeless[row[here], column[here]]]
            value = disparity[row[here], column[here]]
            same = np.abs(value - disparity[rows[here], columns[here]]) <= SAME_SURFACE * distance
            found[here[same]] = value[same]
    return found
