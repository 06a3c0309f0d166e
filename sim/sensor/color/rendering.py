"""Effects that change how the images are rendered: each decides whether the scene calls for it.

- The projector of an infrared pair: dots give texture to plain walls, where other light does not drown them;
  `digs_warp.sim.render.projector` draws them.
- The rolling shutter: rows are rendered in bands, each from the pose at which it was read
  (`digs_warp.sim.camera.shutter`); depth, mask and images are distorted together.
- Motion blur: an image is the mean of several views along the path, in linear light.
- Calibration drift: since the factory, the right eye has turned, and its focal length and baseline changed.
  It is rendered so (`digs_warp.sim.sensor.drift`): nothing is interpolated. The tiers that match the images
  get misaligned rows and errors that depend on the place in the image.
"""

import zlib
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.drift import Drift
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above, choose_by_share
from digs_warp.sim.sensor.facts import SceneFacts

# Jump between neighboring bands: too small to be seen.
STEP_PX = 0.5
MIN_BANDS, MAX_BANDS = 2, 32

BANDS_COST = 60.0  # of rendering in bands [ms/MP]


@dataclass(frozen=True)
class RollingShutter:
    """Renders each row from the pose at which it was read."""

    name: ClassVar[str] = "rolling-shutter"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if the image moves visibly while the rows are read."""
        return choose_by_share(
            self.name,
            "skewed_share",
            facts.skewed_share,
            BANDS_COST,
            on="the hand moves far enough while the rows are read to distort the images",
            off="the rows are read too fast, or all at once, for the hand to distort the images",
        )

    def bands(self, facts: SceneFacts, rig: StereoRig, strength: float = 1.0) -> int:
        """Return the number of bands of rows; ``strength`` stretches the read-out time."""
        bands = int(np.clip(np.ceil(strength * facts.skew_px / STEP_PX), MIN_BANDS, MAX_BANDS))
        return min(bands, rig.intrinsics.height)


# Views per exposure: views this far apart [px] leave no visible gap; more than 16 are not worth their cost.
VIEW_PX = 1.5
MIN_VIEWS, MAX_VIEWS = 2, 16

# The usual rays of a pixel are shared among the views; every further view of both eyes costs [ms/MP]:
USUAL_RAYS, VIEW_COST = 4, 650.0


@dataclass(frozen=True)
class ImageBlur:
    """Spreads the exposure over the motion."""

    name: ClassVar[str] = "image-blur"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if the image moves visibly during the exposure."""
        return choose_by_share(
            self.name,
            "blurred_share",
            facts.blurred_share,
            VIEW_COST * max(0, self.views(facts) - USUAL_RAYS),
            on="the hand moves far enough during an exposure to blur the images",
            off="the shutter is too fast for the hand to blur the images",
        )

    def views(self, facts: SceneFacts, strength: float = 1.0) -> int:
        """Return the number of views per exposure, which is ``strength`` times as long as the rig's."""
        return int(np.clip(np.ceil(strength * facts.blur_px / VIEW_PX), MIN_VIEWS, MAX_VIEWS))


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


# Dots that drown in the image noise in all but this share of the view do not help a matcher [tuned].
MIN_SHARE = 0.01

PROJECTOR_COST = 500.0  # of its rays and spots in both eyes [ms/MP]


@dataclass(frozen=True)
class Projector:
    """Draws pseudo-random dots into the infrared pair."""

    name: ClassVar[str] = "projector"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if the center of a dot would stand out of the image noise."""
        return choose_above(
            self.name,
            "dot_share",
            facts.dot_share,
            MIN_SHARE,
            "",
            PROJECTOR_COST if rig.projector_power > 0 else 0.0,
            on="the projector's dots show: they are texture for the infrared pair",
            off="other light drowns the projector's dots"
            if rig.projector_power > 0
            else "the camera has no projector",
        )
