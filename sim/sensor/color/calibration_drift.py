"""Calibration drift: since the factory, the right eye has turned, and its focal length and baseline changed.

The right eye is rendered turned, with its own focal length (`digs_warp.sim.sensor.drift`): nothing is
interpolated, and what comes into view at its borders is what is there. The tiers that match the images then
get misaligned rows and errors that depend on the place in the image.
"""

import zlib
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.drift import Drift
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.facts import SceneFacts

# Smallest shift that matters [px]: below the step of a matcher.
VISIBLE_SHIFT_PX = 0.05


@dataclass(frozen=True)
class CalibrationDrift:
    """Rotation, focal length and baseline, drawn once for a recording: the same in all of its frames."""

    name: ClassVar[str] = "calibration-drift"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if a drift of one standard deviation shows."""
        corner, scale = corner_shift(rig), rig.baseline_drift * rig.focal_baseline / facts.min_depth
        on = corner > VISIBLE_SHIFT_PX or scale > VISIBLE_SHIFT_PX
        return Choice(
            self.name,
            bool(on),
            f"corner_shift = {corner:.3g} px, baseline_shift = {scale:.3g} px",
            f"either > {VISIBLE_SHIFT_PX:g} px",
            "the eyes are not quite where the factory calibration says"
            if on
            else "the rig keeps its calibration",
            share=float(on),
        )

    def draw(self, rig: StereoRig, seed: int, strength: float = 1.0) -> Drift:
        """Return the drift of a recording.

        Args:
            rig: its standard deviations, and the unit.
            seed: of the recording, >= 0.
            strength: factor on the drift, >= 0.
        """
        rng = np.random.default_rng([seed, rig.unit, zlib.crc32(self.name.encode())])
        pitch, yaw, roll, focal, baseline = (strength * rng.standard_normal(5)).tolist()
        return Drift(
            pitch_deg=rig.rotation_drift * pitch,
            yaw_deg=rig.rotation_drift * yaw,
            roll_deg=rig.rotation_drift * roll,
            focal=rig.focal_drift * focal,
            baseline=rig.baseline_drift * baseline,
        )


def corner_shift(rig: StereoRig) -> float:
    """Return the standard deviation of the right image's displacement in its first corner [px]."""
    turn, k = rig.rotation_drift, rig.intrinsics
    corner = np.zeros(1)
    each = (Drift(pitch_deg=turn), Drift(yaw_deg=turn), Drift(roll_deg=turn))
    shifts = [drift.shift(corner, corner, k) for drift in (*each, Drift(focal=rig.focal_drift))]
    return float(np.sqrt(np.sum(np.square(shifts))))
