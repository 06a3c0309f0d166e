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

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.drift import Drift
from digs_warp.sim.sensor.effects.protocol import Effect
from digs_warp.sim.sensor.facts import SceneFacts

# Jump between neighboring bands: too small to be seen.
STEP_PX = 0.5
MIN_BANDS, MAX_BANDS = 2, 32


class RollingShutter(Effect):
    """Each row is exposed a little later than the one above it, and rendered from its own pose."""

    name = "rolling-shutter"
    statistic = "skewed_share"
    of_pixels = True
    cost = 60.0  # of rendering in bands
    on = "the hand moves far enough while the rows are read to distort the images"
    off = "the rows are read too fast, or all at once, for the hand to distort the images"

    def bands(self, facts: SceneFacts, rig: StereoRig, strength: float = 1.0) -> int:
        """Return the number of bands of rows; ``strength`` stretches the read-out time."""
        bands = int(np.clip(np.ceil(strength * facts.skew_px / STEP_PX), MIN_BANDS, MAX_BANDS))
        return min(bands, rig.intrinsics.height)


# Views per exposure: views this far apart [px] leave no visible gap; more than 16 are not worth their cost.
VIEW_PX = 1.5
MIN_VIEWS, MAX_VIEWS = 2, 16

# The usual rays of a pixel are shared among the views; every further view of both eyes costs [ms/MP]:
USUAL_RAYS, VIEW_COST = 4, 650.0


class ImageBlur(Effect):
    """The camera moves while the shutter is open: the exposure is spread over the motion."""

    name = "image-blur"
    statistic = "blurred_share"
    of_pixels = True
    on = "the hand moves far enough during an exposure to blur the images"
    off = "the shutter is too fast for the hand to blur the images"

    def price(self, facts: SceneFacts, rig: StereoRig) -> float:
        """Return the cost of the views beyond the usual rays."""
        return VIEW_COST * max(0, self.views(facts) - USUAL_RAYS)

    def views(self, facts: SceneFacts, strength: float = 1.0) -> int:
        """Return the number of views per exposure, which is ``strength`` times as long as the rig's."""
        return int(np.clip(np.ceil(strength * facts.blur_px / VIEW_PX), MIN_VIEWS, MAX_VIEWS))


class CalibrationDrift(Effect):
    """Since the factory the right eye has turned, and its focal length and baseline changed."""

    name = "calibration-drift"
    statistic = "shift of the right image"
    limit = 0.05  # below the step of a matcher
    unit = "px"
    on = "the eyes are not quite where the factory calibration says"
    off = "the rig keeps its calibration"

    def measured(self, facts: SceneFacts, rig: StereoRig) -> float:
        """Return a standard deviation, in a corner or by the baseline, whichever is larger."""
        by_baseline = rig.baseline_drift * rig.focal_baseline / facts.min_depth
        return float(np.fmax(corner_shift(rig), by_baseline))

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


class Projector(Effect):
    """Random dots give texture to plain walls of an infrared pair, where other light does not drown them."""

    name = "projector"
    statistic = "dot_share"
    limit = 0.01  # dots that drown in the image noise elsewhere do not help a matcher [tuned]
    cost = 500.0  # of its rays and spots in both eyes
    on = "the projector's dots show: they are texture for the infrared pair"
    off = "the camera has no projector, or other light drowns its dots"
