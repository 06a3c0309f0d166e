"""Specular match: on glossy surfaces with little texture the matcher locks onto the highlight."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.coherent import coherent_uniform
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.filters import horizontal_gradient
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.materials import highlights_on, is_glossy, pixels_of
from digs_warp.sim.sensor.steps import pixels_where
from digs_warp.sim.sensor.virtual_image import virtual_disparity

# The effect switches on if at least this share of the surface in view is glossy.
MIN_SHARE = 1e-4

# Smallest shift between highlight and surface that causes wrong matches [px].
MIN_SHIFT = 1.0

# Share of confident wrong matches by shift [px], measured with a highlight that moves over a plane with
# weak texture (3 DN). With strong texture (20 DN) the surface mostly wins, and shifts of 5 px and more
# leave holes.
SHIFTS = (1.0, 2.0, 5.0, 10.0)
WRONG_SHARES_WEAK = (0.0, 0.57, 0.79, 0.91)
WRONG_SHARES_STRONG = (0.0, 0.0, 0.10, 0.36)
HOLE_SHARES_STRONG = (0.0, 0.0, 0.19, 0.20)
WEAK_TEXTURE, STRONG_TEXTURE = 3.0, 20.0  # [DN]

# RMS contrast of a texture per mean gradient along the rows [px]: textures here vary over a few pixels.
CONTRAST_PER_GRADIENT = 2.0

COHERENCE = 6.0


@dataclass(frozen=True)
class Specular:
    """Confidently wrong depth, and some holes, in the highlights of glossy surfaces."""

    name: ClassVar[str] = "specular"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if highlights on glossy surfaces differ between the eyes."""
        on = facts.specular_share >= MIN_SHARE and facts.highlight_shift >= MIN_SHIFT
        if facts.specular_share < MIN_SHARE:
            reason = "no glossy surface in view"
        elif on:
            reason = "highlights move between the two eyes: the matcher follows them"
        else:
            reason = "highlights stay on the surface: following them does no harm"
        statistic = (
            f"specular_share = {facts.specular_share:.2%}, "
            f"highlight_shift = {facts.highlight_shift:.1f} px"
        )
        return Choice(self.name, on, statistic, f">= {MIN_SHARE:.2%}, >= {MIN_SHIFT} px", reason)

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Match highlights instead of the surface; ``strength`` is a factor on their shift."""
        glossy = pixels_of(truth, is_glossy) if strength > 0 else None
        if glossy is None or not glossy.any():
            return sensed
        highlight = highlights_on(truth, glossy)
        if not highlight.any():
            return sensed
        texture = np.median(np.abs(horizontal_gradient(truth.gray))[glossy]) * CONTRAST_PER_GRADIENT
        image = virtual_disparity(truth, highlight)
        image = truth.disparity + strength * (image - truth.disparity)

        rows, columns = pixels_where(highlight)
        shift = np.abs(image[rows, columns] - truth.disparity[rows, columns])
        wrong_share, hole_share = failure_shares(shift, float(texture))
        drawn = coherent_uniform(rng, glossy.shape, rows, columns, COHERENCE)
        wrong, lost = np.zeros_like(glossy), np.zeros_like(glossy)
        wrong[rows, columns] = drawn < wrong_share
        lost[rows, columns] = (drawn >= wrong_share) & (drawn < wrong_share + hole_share)
        return sensed.with_values(wrong, image, Cause.SPECULAR, 0.8).with_holes(
            lost, Cause.SPECULAR
        )


def failure_shares(shift: np.ndarray, texture: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the shares of wrong matches and of holes in a highlight.

    Args:
        shift: between the disparities of highlight and surface [px], any shape.
        texture: RMS contrast of the surface's own texture [DN].
    """
    strong = np.clip((texture - WEAK_TEXTURE) / (STRONG_TEXTURE - WEAK_TEXTURE), 0.0, 1.0)
    weak_wrong = np.interp(shift, SHIFTS, WRONG_SHARES_WEAK)
    strong_wrong = np.interp(shift, SHIFTS, WRONG_SHARES_STRONG)
    holes = np.interp(shift, SHIFTS, HOLE_SHARES_STRONG)
    return (1 - strong) * weak_wrong + strong * strong_wrong, strong * holes
