"""Mis-rectification: after a knock, or with warm lenses, the rows of the two eyes are no longer aligned."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.noise_field import smooth_normal

# RMS disparity error [px] and share of matched pixels by row offset [px]: semi-global matching of pairs
# that were shifted on purpose. A rectified pair has 0.13 px.
OFFSETS = (0.0, 0.25, 0.5, 1.0, 1.5, 2.0)
RMS = (0.13, 0.143, 0.164, 0.243, 0.359, 0.443)
FILL = (1.0, 1.0, 1.0, 1.0, 0.94, 0.28)

# Smallest offset of rows or columns that matters [px].
MIN_OFFSET = 0.05


@dataclass(frozen=True)
class MisRectification:
    """More noise and holes from a row offset, a bias Z^2 dd / (f b) from a column offset."""

    name: ClassVar[str] = "mis-rectification"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On for rigs whose calibration has drifted."""
        on = max(abs(rig.row_offset), abs(rig.column_offset)) > MIN_OFFSET
        reason = (
            "the calibration has drifted: rows of the two eyes are not aligned, or columns are off"
            if on
            else "the rig is well calibrated"
        )
        statistic = f"row_offset = {rig.row_offset:g} px, column_offset = {rig.column_offset:g} px"
        return Choice(self.name, on, statistic, f"|either| > {MIN_OFFSET} px", reason)

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Add noise, bias and holes; ``strength`` is a factor on the offsets."""
        from scipy.stats import norm

        rig = truth.rig
        rows = abs(rig.row_offset) * strength
        # Excess over the noise of a rectified pair, which is a separate effect.
        excess = np.sqrt(np.interp(rows, OFFSETS, RMS) ** 2 - RMS[0] ** 2)
        if excess > 0:
            noise = smooth_normal(rng, truth.depth.shape, rig.noise_correlation)
            sensed = sensed.shifted(np.float32(excess) * noise)
        if rig.column_offset:
            sensed = sensed.shifted(strength * rig.column_offset)
        fill = np.interp(rows, OFFSETS, FILL)
        if fill < 1:
            patches = smooth_normal(rng, truth.depth.shape, 2 * rig.noise_correlation)
            sensed = sensed.with_holes(patches > norm.ppf(fill), Cause.RECTIFICATION)
        return sensed
