"""Flying pixels: a filter after the matcher blends near and far depth into points in mid-air."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.steps import Steps, find_steps

# Blends across smaller jumps are hardly wrong [px].
STEP = 3.0

# The effect switches on if at least this share of the surface in view lies at a large step.
MIN_SHARE = 1e-4

# Blends closer than this to either side do not count as flying pixels.
MARGIN = 0.15


@dataclass(frozen=True)
class FlyingPixels:
    """Interpolated depth at the steps, for sensors that smooth or enlarge their disparity.

    Attributes:
        width: flying pixels per pixel of outline. Measured: 0.65 to 1.65 for disparity that was computed at
            half size and enlarged linearly; 0.003 to 0.016 for plain semi-global matching with a left-right
            check. So only profiles with a post-filter have them.
    """

    name: ClassVar[str] = "flying-pixels"
    width: float = 1.15

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On for rigs with a post-filter if there are large steps."""
        on = rig.post_filter and facts.large_step_share >= MIN_SHARE
        if not rig.post_filter:
            reason = "the sensor has no filter after the matcher: it makes no flying pixels"
        elif on:
            reason = "the sensor's filter blends across large depth steps"
        else:
            reason = "no depth steps large enough to blend across"
        statistic = (
            f"post_filter = {rig.post_filter}, large_step_share = {facts.large_step_share:.2%}"
        )
        return Choice(self.name, on, statistic, f"a filter and >= {MIN_SHARE:.2%}", reason)

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Blend the sensed disparity across its steps; ``strength`` is a factor on how far."""
        if strength <= 0:
            return sensed
        disparity = sensed.disparity.copy()
        blended = np.zeros(disparity.shape, dtype=bool)
        # The transposed arrays are views: writing to them writes to the frame.
        along_rows, along_columns = find_steps(sensed.disparity, STEP)
        for steps, source, target, mark in (
            (along_rows, sensed.disparity, disparity, blended),
            (along_columns, sensed.disparity.T, disparity.T, blended.T),
        ):
            _blend(steps, source, strength * self.width, rng, target, mark)
        return sensed.with_values(blended, disparity, Cause.FLYING, confidence=0.5)


def _blend(
    steps: Steps,
    source: np.ndarray,
    width: float,
    rng: np.random.Generator,
    disparity: np.ndarray,
    blended: np.ndarray,
) -> None:
    """Blend ``source`` along the rows over ``width`` pixels per step into ``disparity``."""
    near = source[steps.rows, steps.near]
    far = source[steps.rows, steps.far]
    count = np.floor(width + rng.random(len(near)))
    for place in range(int(count.max(initial=0))):
        # Sides alternate: the first blend is on the far side, the second on the near side.
        start, way = (steps.far, 1) if place % 2 == 0 else (steps.near, -1)
        column = start + way * (place // 2) * steps.away
        inside = (count > place) & (column >= 0) & (column < source.shape[1])
        rows, column = steps.rows[inside], column[inside]
        share = rng.uniform(MARGIN, 1 - MARGIN, len(rows))
        value = far[inside] + share * (near - far)[inside]
        known = ~np.isnan(source[rows, column])
        disparity[rows[known], column[known]] = value[known]
        blended[rows[known], column[known]] = True
