"""Edge fattening: a matching window across a depth step takes the depth of the side with more texture.

Narrow gaps between near objects close completely; thin near objects survive.
"""

from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.coherent import coherent_normal, coherent_uniform
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.steps import Runs, Steps, find_steps
from digs_warp.sim.sensor.texture import noise_of

# Smallest jump that a window notices [px] (measured on textured steps of 10 to 40 px).
STEP = 2.0

# Displacement of the outline [px] for a window of half-width h if one side's texture is five times as
# strong as the other's: a least-squares fit to semi-global matching of synthetic steps with windows of 5, 9
# and 15. A strong foreground grows by 2.3, 3.4 and 4.9 px, a weak one shrinks by 1.6, 2.2 and 2.9 px.
GROWTH = (1.15, 0.53)
EROSION = (1.0, 0.27)
SATURATION = np.log(5.0)

# Along columns the outline moves a third to a half as far as along rows if both sides have texture. It
# moves as far in front of a background whose gradient is lost in the image noise (rendered frames of four
# meshes): there only smoothness decides, which has no direction.
VERTICAL_SNRS, VERTICAL_SHARES = (0.75, 2.0), (1.0, 0.5)

# With equal texture on both sides the outline still wanders between -1 and +0.6 px.
EQUAL_SHIFT, WANDER = -0.2, 0.4
COHERENCE = 5.0

# On real and rendered outlines the displacement varies more than on synthetic ones: its 10, 50 and 90 %
# quantiles are about 0, 2 and 5 px for a mean of 2.2 px, as in a gamma distribution of this shape.
SPREAD_SHAPE = 2.0

# Shares of the gaps between two near objects that are closed with their depth, and that become holes, by
# width [px]: semi-global matching with a window of 5, of a real pair and of rendered frames of six meshes.
GAP_WIDTHS = (6.0, 10.0, 13.0, 20.0, 32.0, 41.0)
GAP_CLOSED = (0.75, 0.65, 0.45, 0.25, 0.15, 0.0)
GAP_LOST = (0.10, 0.25, 0.25, 0.15, 0.05, 0.0)
GAP_COHERENCE = 16.0

# Gradient of an evenly lit wall [DN/px]: below it texture is noise, and ratios are meaningless.
TEXTURE_FLOOR = 0.5

# The effect switches on if a larger share of the surface in view lies at a step.
MIN_SHARE = 1e-4


@dataclass(frozen=True)
class EdgeFattening:
    """Near objects that look too fat or too thin, depending on the texture on both sides."""

    name: ClassVar[str] = "edge-fattening"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if there are depth steps."""
        way = "grow" if facts.step_contrast > 0 else "shrink"
        return choose_above(
            self.name,
            "step_share",
            facts.step_share,
            MIN_SHARE,
            "",
            on=f"the matching window straddles depth steps: near objects mostly {way}",
            off="no depth steps for the window to straddle",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Move the outlines of near objects; ``strength`` is a factor on how far."""
        if strength <= 0:
            return sensed
        half = truth.rig.window // 2
        along_rows, along_columns = find_steps(truth.disparity, STEP)
        sideways = _Work(
            along_rows,
            truth.disparity,
            truth.gradient,
            noise_of(truth.rig.image_noise),
            sensed.disparity,
            sensed.disparity.copy(),
            np.zeros(sensed.disparity.shape, dtype=bool),
        )
        upright = sideways.turned(along_columns)
        _move(sideways, half, (strength, strength), rng)
        _move(upright, half, tuple(strength * share for share in VERTICAL_SHARES), rng)
        _close_gaps(sideways, strength, rng)
        _close_gaps(upright, strength, rng)
        at = np.flatnonzero(sideways.moved)
        values = sideways.disparity.reshape(-1)[at]
        confidence = np.where(np.isnan(values), np.float32(0.0), np.float32(0.6))
        return sensed.with_pixels(at, values, Cause.EDGE, confidence)


@dataclass(frozen=True, eq=False)
class _Work:
    """The frame being changed, along its rows; all (height, width).

    Attributes:
        steps: along its rows.
        true: disparity that has the steps [px].
        texture: strength of the texture [DN/px].
        noise: of the image [DN].
        source: sensed disparity before the effect [px].
        disparity: the same, after the effect.
        moved: pixels that the effect has written.
    """

    steps: Steps
    true: np.ndarray
    texture: np.ndarray
    noise: float
    source: np.ndarray
    disparity: np.ndarray
    moved: np.ndarray

    def turned(self, steps: Steps) -> "_Work":
        """Return the transposed frame with its steps; writing to it writes to this one."""
        images = (self.source.T, self.disparity.T, self.moved.T)
        return _Work(steps, self.true.T, self.texture.T, self.noise, *images)

    def write(self, rows: np.ndarray, columns: np.ndarray, values: np.ndarray) -> None:
        """Write disparities at some pixels."""
        self.disparity[rows, columns] = values
        self.moved[rows, columns] = True


def outline_shift(near_texture: np.ndarray, far_texture: np.ndarray, half: int) -> np.ndarray:
    """Return how far an outline moves outward [px]; negative: the near object shrinks.

    Args:
        near_texture: strength of the texture of the nearer side [DN/px], >= 0.
        far_texture: of the farther side.
        half: half the width of the window [px].
    """
    ratio = np.maximum(near_texture, TEXTURE_FLOOR) / np.maximum(far_texture, TEXTURE_FLOOR)
    contrast = np.clip(np.log(ratio) / SATURATION, -1.0, 1.0)
    growth, erosion = GROWTH[0] + GROWTH[1] * half, EROSION[0] + EROSION[1] * half
    return EQUAL_SHIFT * (1 - np.abs(contrast)) + np.where(
        contrast > 0, growth * contrast, erosion * contrast
    )


def _move(work: _Work, half: int, strengths: tuple[float, ...], rng: np.random.Generator) -> None:
    """Move the outlines along the rows, for a window of half-width ``half`` [px].

    ``strengths`` are factors on how far, in front of a background without and with texture.
    """
    steps, texture, shape = work.steps, work.texture, work.true.shape
    # The outline moves with the near side and is often its strongest texture: the window on the near side
    # touches it, the one on the far side does not.
    near_window = np.clip(steps.near - half * steps.away, 0, shape[1] - 1)
    far_window = np.clip(steps.far + (half + 2) * steps.away, 0, shape[1] - 1)
    far_texture = texture[steps.rows, far_window]
    shift = outline_shift(texture[steps.rows, near_window], far_texture, half)
    drawn = coherent_uniform(rng, shape, steps.rows, steps.near, COHERENCE)
    shift *= np.interp(drawn, *_spread_quantiles())
    shift += WANDER * coherent_normal(rng, shape, steps.rows, steps.near, COHERENCE)
    shift *= np.interp(far_texture / work.noise, VERTICAL_SNRS, strengths)
    for sign, giver, taker in ((1, steps.near, steps.far), (-1, steps.far, steps.near)):
        pixels = np.floor(np.maximum(sign * shift, 0.0) + rng.random(len(shift)))
        _spread(work, giver, taker, pixels)


@cache
def _spread_quantiles() -> tuple[np.ndarray, np.ndarray]:
    """Return probabilities from 0 to 1 and the quantiles there of a gamma distribution of mean 1.

    Computing its inverse would take longer than the rest of the effect. The table is exact to 1 %, except for
    one outline in ten thousand.
    """
    from scipy.special import gammaincinv, ndtr

    # Evenly spaced in normal quantiles: fine at both ends.
    shares = ndtr(np.linspace(-4.0, 4.0, 257))
    return shares, gammaincinv(SPREAD_SHAPE, shares) / SPREAD_SHAPE


def _spread(work: _Work, giver: np.ndarray, taker: np.ndarray, pixels: np.ndarray) -> None:
    """Give the disparity at ``giver`` to ``pixels`` pixels from ``taker`` on, up to the next step."""
    true, direction = work.true, taker - giver
    for distance in range(int(pixels.max(initial=0))):
        column = taker + distance * direction
        inside = (pixels > distance) & (column >= 0) & (column < true.shape[1])
        rows, column = work.steps.rows[inside], column[inside]
        start, value = taker[inside], work.source[rows, giver[inside]]
        same_side = np.abs(true[rows, column] - true[rows, start]) <= STEP
        usable = same_side & ~np.isnan(value)
        work.write(rows[usable], column[usable], value[usable])


def _close_gaps(work: _Work, strength: float, rng: np.random.Generator) -> None:
    """Close or lose narrow gaps along the rows."""
    steps = work.steps
    # Steps are in reading order: a gap is a step down to the far side, followed by a step up.
    same_row = steps.rows[1:] == steps.rows[:-1]
    gap = np.flatnonzero(same_row & (steps.away[:-1] > 0) & (steps.away[1:] < 0))
    gaps = Runs(steps.rows[gap], steps.far[gap], steps.near[gap + 1])
    narrow = gaps.lengths < GAP_WIDTHS[-1]
    gaps = Runs(gaps.rows[narrow], gaps.first[narrow], gaps.end[narrow])
    rows, columns, run = gaps.pixels()
    width = gaps.lengths[run]
    closed = 1.0 - (1.0 - np.interp(width, GAP_WIDTHS, GAP_CLOSED)) ** strength
    lost = 1.0 - (1.0 - np.interp(width, GAP_WIDTHS, GAP_LOST)) ** strength
    drawn = coherent_uniform(rng, work.true.shape, rows, columns, GAP_COHERENCE)
    nearer_left = columns - gaps.first[run] < width / 2
    beside = np.where(nearer_left, gaps.first[run] - 1, gaps.end[run])
    value = np.where(drawn < closed, work.source[rows, beside], np.nan)
    changed = (drawn < closed + lost) & ~((drawn < closed) & np.isnan(value))
    work.write(rows[changed], columns[changed], value[changed])
