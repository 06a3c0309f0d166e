"""Motion blur: images smeared along the rows are matched less precisely, or wrongly."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.coherent import coherent_normal
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.motion import image_motion
from digs_warp.sim.sensor.steps import pixels_where

# Blur along the rows that does not affect matching [px]; along the columns even 41 px do no harm.
HARMLESS = 9.0

# RMS error [px] by blur [px], semi-global matching of blurred pairs; a sharp pair has 0.13 px.
BLURS = (HARMLESS, 15.0, 25.0, 41.0)
RMS = (0.19, 0.24, 0.35, 0.47)
SHARP_RMS = 0.13

# Share of matches that are wrong by more than a pixel: measured 0 at 25 px and 0.11 at 41 px.
WRONG_SHARES = (0.0, 0.0, 0.0, 0.11)

# A wrong match lands on a neighboring structure of the smeared texture [px] [tuned].
WRONG_ERROR = (1.5, 6.0)


@dataclass(frozen=True)
class MotionBlur:
    """Noisier disparity where the image moves along the rows during the exposure."""

    name: ClassVar[str] = "motion-blur"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if the image moves far enough to affect matching."""
        return choose_above(
            self.name,
            "blur_px",
            facts.blur_px,
            HARMLESS,
            "px",
            on="the camera moves fast enough to smear the texture",
            off="the camera moves too slowly to blur depth",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Add error where the blur is long; ``strength`` is a factor on the length."""
        if strength <= 0:
            return sensed
        motion = truth.motion
        along_rows, _ = image_motion(
            truth.depth, truth.camera.intrinsics, motion.velocity_cam, motion.angular_velocity_cam
        )
        blur = np.abs(along_rows) * np.float32(truth.rig.exposure_time * strength)
        rows, columns = pixels_where((blur > HARMLESS) & sensed.known)
        if len(rows) == 0:
            return sensed
        length = blur[rows, columns]
        shape = truth.depth.shape
        # Smeared texture is correlated over the length of the blur, and so is the error.
        cell = truth.rig.noise_correlation + 0.5 * float(np.median(length))
        noise = coherent_normal(rng, shape, rows, columns, cell)
        # Excess over the noise of a sharp pair, which is a separate effect.
        error = noise * np.sqrt(np.interp(length, BLURS, RMS) ** 2 - SHARP_RMS**2)
        wrong = np.interp(length, BLURS, WRONG_SHARES)
        drawn = coherent_normal(rng, shape, rows, columns, cell)
        missed = np.abs(drawn) > _quantile(wrong)
        error[missed] = (np.sign(drawn) * rng.uniform(*WRONG_ERROR, len(drawn)))[missed]

        disparity = sensed.disparity.copy()
        disparity[rows, columns] += error.astype(np.float32)
        where = np.zeros(shape, dtype=bool)
        where[rows[missed], columns[missed]] = True
        return replace(sensed, disparity=disparity).with_values(
            where, disparity, Cause.MOTION, confidence=0.3
        )


def _quantile(two_sided_share: np.ndarray) -> np.ndarray:
    """Return what the magnitude of a standard normal value exceeds with this probability."""
    from scipy.special import ndtri

    with np.errstate(divide="ignore"):
        return -ndtri(0.5 * two_sided_share)
