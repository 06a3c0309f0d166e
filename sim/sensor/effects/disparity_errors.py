"""After matching: what the device drops and smooths, the lens error that calibration leaves, and steps."""

import zlib
from dataclasses import replace
from functools import lru_cache

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import DepthEffect
from digs_warp.sim.sensor.filters import enlarge
from digs_warp.sim.sensor.frame import Cause, Sensed
from digs_warp.sim.sensor.law import STAYING, lasting_field, moved_with
from digs_warp.sim.sensor.noise_field import octave_normal, smooth_normal


class Rejection(DepthEffect):
    """The device keeps only matches that it trusts, by their confidence: small holes, as real ones have."""

    name = "rejection"
    statistic = "least_confidence"
    cost = 3.0
    on = "the device drops doubtful matches"
    off = "the device keeps all matches"

    def apply(
        self, sensed: Sensed, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Drop them; ``strength`` makes no difference."""
        weak = sensed.confidence < np.float32(rig.least_confidence)
        return sensed.with_holes(weak, Cause.LOW_CONFIDENCE)


class Smoothing(DepthEffect):
    """The device averages its matches along rows and columns, but not across steps."""

    name = "smoothing"
    statistic = "smoothing"
    cost = 7.0
    on = "the device averages neighboring matches"
    off = "the device reports its matches as they are"

    def apply(
        self, sensed: Sensed, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Average them; ``strength`` makes no difference."""
        from digs_warp.sim.sensor.smoothing import smooth_spatially  # starts Warp

        return replace(sensed, disparity=smooth_spatially(sensed.disparity, 1 - rig.smoothing))


class Speckle(DepthEffect):
    """Speckle of the laser, in no image here: a part stays on the surface, a part changes in every frame."""

    name = "speckle"
    statistic = "speckle"
    unit = "px"
    cost = 3.0
    on = "the laser makes speckle"
    off = "there is no laser, or it makes no noise"

    def apply(
        self, sensed: Sensed, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Add the noise; ``strength`` is a factor on it."""
        if strength * rig.speckle == 0:
            return sensed
        shape, correlation = sensed.disparity.shape, rig.disparity_correlation
        noise = np.float32(rig.changing_sigma) * octave_normal(rng, shape, correlation)
        if rig.lasting_speckle > 0:
            lasting = lasting_field(rig.unit, STAYING, shape, correlation)
            noise += np.float32(rig.lasting_speckle) * moved_with(lasting, sensed.disparity)
        return replace(sensed, disparity=sensed.disparity + np.float32(strength) * noise)


# Correlation length, as a share of the image width: 46 px on the pair (741 px wide) that shows it.
SCALE = 1 / 16

# The field is drawn on a grid with this many points per correlation length.
POINTS = 4


class StaticField(DepthEffect):
    """A smooth disparity error that belongs to the unit: ``rig.unit`` selects it.

    On a real pair with ground truth, 0.15 to 0.2 px of error varies over 40 px and more; ideal pairs do not
    have it.
    """

    name = "static-field"
    statistic = "static_field"
    unit = "px"
    cost = 2.0
    on = "calibration leaves a smooth error, different in every camera"
    off = "the rig is calibrated perfectly"

    def apply(
        self, sensed: Sensed, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Add the field; ``strength`` is a factor on it."""
        k = rig.intrinsics
        field = unit_field(rig.unit, k.width, k.height)
        error = np.float32(strength * rig.static_field) * field
        return replace(sensed, disparity=sensed.disparity + error)


@lru_cache(maxsize=4)
def unit_field(unit: int, width: int, height: int) -> np.ndarray:
    """Return the field of one unit, of mean 0 and variance 1, (height, width), float32.

    Frames share it: do not write to it.
    """
    rng = np.random.default_rng([unit, zlib.crc32(StaticField.name.encode())])
    grid = max(1.0, SCALE * width / POINTS)
    coarse = (int(np.ceil(height / grid)) + 1, int(np.ceil(width / grid)) + 1)
    field = enlarge(smooth_normal(rng, coarse, POINTS), (height, width), cubic=True)
    field -= field.mean()
    spread = field.std()
    return field / spread if spread > 0 else field


class Quantum(DepthEffect):
    """Rounding to the rig's disparity step: 1/16 px in OpenCV, 1/32 in a D435, 1/8 in an OAK-D."""

    name = "quantum"
    statistic = "disparity_step"
    unit = "px"
    cost = 2.0
    on = "the sensor reports disparity in fixed point"
    off = "the rig reports disparity without steps"

    def apply(
        self, sensed: Sensed, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Round the disparity; ``strength`` is a factor on the step."""
        step = np.float32(strength * rig.disparity_step)
        if step <= 0:
            return sensed
        steps = np.rint(sensed.disparity / step)
        steps *= step
        return replace(sensed, disparity=steps)
