"""The threshold and the filters of a device, one after the other, and the labels of what they changed.

The temporal filter is written from Intel's description ("Depth Post-Processing for Intel RealSense Depth
Camera D400 Series", Grunnet-Jepsen and Tong, and the documentation of the post-processing filters): the
exponential moving average of `spatial`, from frame to frame. A hole takes the last value of its pixel if that
had one in two of the last four frames, so that three earlier frames are all it needs.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.error_attribution import WRONG
from digs_warp.sim.sensor.frame import Cause, Sensed
from digs_warp.sim.sensor.post_filters.dense import smooth_densely
from digs_warp.sim.sensor.post_filters.hole_filling import Way, sources_of_holes
from digs_warp.sim.sensor.post_filters.names import FILTERS, filters_named
from digs_warp.sim.sensor.post_filters.spatial import smooth_spatially

# Defaults of librealsense; its delta of 20 counts 32nds of a pixel.
TEMPORAL_ALPHA = 0.4
TEMPORAL_DELTA = 20 / 32

# A hole is filled if its pixel had a value in this many of the last frames.
PERSISTENCY = 2

# Frames before the one that is recorded: with it, the four that persistency looks at. What still earlier
# ones would add has a weight of 0.13.
EARLIER_FRAMES = 3


def smooth_over_time(
    frames: Sequence[tuple[np.ndarray, np.ndarray]],
    alpha: float = TEMPORAL_ALPHA,
    delta: float = TEMPORAL_DELTA,
) -> tuple[np.ndarray, np.ndarray]:
    """Return disparity and confidence of the last frame after the filter, each (height, width), float32.

    The confidence stays; filled holes have that of the last match.

    Args:
        frames: disparity [px], (height, width), float32, NaN where there is none, and confidence; the
            earliest first.
        alpha: weight of the newer frame, 0 to 1; 1 averages nothing.
        delta: larger differences are changes, which the newer frame decides [px].
    """
    average, trust = frames[0]
    seen = (~np.isnan(average)).astype(np.uint8)
    for disparity, confidence in frames[1:]:
        known = ~np.isnan(disparity)
        change = disparity - average
        smooth = np.where(np.abs(change) < delta, average + np.float32(alpha) * change, disparity)
        average = np.where(known, smooth, average)
        trust = np.where(known, confidence, trust)
        seen += known
    lost = np.isnan(frames[-1][0]) & (seen < PERSISTENCY)
    return np.where(lost, np.float32(np.nan), average), np.where(lost, np.float32(0), trust)


# Disparity [px], confidence and the gray left image -> disparity and confidence.
Filter = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Shot:
    """What a camera has of a frame.

    Attributes:
        sensed: the matches.
        gray: left image as recorded, (height, width), uint8.
    """

    sensed: Sensed
    gray: np.ndarray


@dataclass(frozen=True)
class AfterMatching:
    """What the device does with its matches.

    Attributes:
        filters: their names, in the order in which they act; see `names.filters_named`.
        threshold: matches with less confidence are dropped before the filters, 0 to 1.
    """

    filters: tuple[str, ...] = ()
    threshold: float = 0.0

    @staticmethod
    def of(config: SimulateConfig) -> "AfterMatching":
        """Return what the settings ask for; nothing at strength 0, where depth is the truth."""
        if config.strength == 0:
            return AfterMatching()
        return AfterMatching(filters_named(config.filters), config.confidence_threshold)

    @property
    def acts(self) -> bool:
        """Whether it changes anything."""
        return bool(self.filters) or self.threshold > 0

    @property
    def earlier_frames(self) -> int:
        """How many frames before the recorded one the filters need."""
        return EARLIER_FRAMES if "temporal" in self.filters else 0

    def apply(self, frames: Sequence[Shot]) -> Sensed:
        """Return the last frame after the threshold and the filters.

        What the threshold drops, holes that a filter fills, and values that the filters move by more than a
        pixel get a label; no filter takes a value away. A filled hole has the confidence of the pixel that
        fills it; `dense` has the mean confidence round each pixel.

        Args:
            frames: what the camera saw: the recorded frame, and before it `earlier_frames` others.
        """
        kept = [self._trusted(shot.sensed) for shot in frames]
        values = [(sensed.disparity, sensed.confidence) for sensed in kept]
        for name in self.filters:
            if name == "temporal":
                values = [smooth_over_time(values)]
            else:
                shots = zip(values, frames[-len(values) :], strict=True)
                values = [_FILTERS[name](*value, shot.gray) for value, shot in shots]
        return _labeled(kept[-1], *values[-1])

    def _trusted(self, sensed: Sensed) -> Sensed:
        if self.threshold == 0:
            return sensed
        weak = sensed.confidence < np.float32(self.threshold)
        return sensed.own().with_holes(weak, Cause.LOW_CONFIDENCE)


def _labeled(sensed: Sensed, disparity: np.ndarray, confidence: np.ndarray) -> Sensed:
    """Return the frame with new values, and labels where they differ much."""
    cause = sensed.cause.copy()
    cause[~sensed.known & ~np.isnan(disparity)] = Cause.FILLED
    cause[np.abs(disparity - sensed.disparity) > WRONG] = Cause.FILTERED
    return Sensed(disparity, cause, confidence)


def _spatial(
    disparity: np.ndarray, confidence: np.ndarray, gray: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    return smooth_spatially(disparity), confidence


def _filling(way: Way) -> Filter:
    def fill(
        disparity: np.ndarray, confidence: np.ndarray, gray: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        source = sources_of_holes(disparity, way)
        return np.take(disparity, source), np.take(confidence, source)

    return fill


_FILTERS: dict[str, Filter] = {
    "dense": smooth_densely,
    "spatial": _spatial,
    "hole-filling": _filling("farthest"),
    "hole-filling-left": _filling("left"),
    "hole-filling-nearest": _filling("nearest"),
}


# Time of each on one core [ms per megapixel], measured and rounded up.
COSTS = {
    "dense": 25,
    "spatial": 7,
    "temporal": 20,
    "hole-filling": 11,
    "hole-filling-left": 11,
    "hole-filling-nearest": 11,
}


def choices_of(device: AfterMatching) -> tuple[Choice, ...]:
    """Return a choice for the threshold and for each filter, in the order in which they act.

    All are on: nothing but the user decides about them.
    """
    choices = []
    if device.threshold > 0:
        reason = "asked for: doubtful matches are dropped"
        measured = f"confidence_threshold = {device.threshold:g}"
        choices.append(Choice("confidence-threshold", True, measured, "> 0", reason))
    for name in device.filters:
        reason = f"asked for: {FILTERS[name]}"
        if name == "temporal":
            reason += f", and {device.earlier_frames} more frames to render and match for each"
        choices.append(Choice(name, True, "", "", reason, 1.0, COSTS[name]))
    return tuple(choices)
