"""Occlusion: points hidden from the right eye have no match, and the matcher notices only some of them."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.coherent import coherent_uniform
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.steps import Runs, find_runs

# The effect switches on if a larger share is hidden.
MIN_SHARE = 1e-4

# Share of holes among hidden pixels, by the length of the hidden run and by the distance to the occluder
# [px]: semi-global matching with a window of 5 and a left-right check, mean of a real pair with true
# disparity (Middlebury Motorcycle) and of rendered frames of six meshes. The window and the smoothness term
# carry the near disparity across the first few pixels; farther away the left-right check works.
RUN_LENGTHS = (1.0, 2.0, 4.0, 6.5, 10.0, 16.0, 30.0, 55.0, 100.0)
HOLE_SHARES_NEAR = (0.15, 0.20, 0.25, 0.30, 0.33, 0.36, 0.36, 0.36, 0.36)
HOLE_SHARES_FAR = (0.15, 0.20, 0.45, 0.65, 0.80, 0.82, 0.86, 0.89, 0.97)
NEAR_REACH, FAR_REACH = 1.0, 12.0

# The same for every whole length: a table is much faster than interpolation.
_LENGTHS = np.arange(RUN_LENGTHS[-1] + 1)
_NEAR_BY_LENGTH = np.interp(_LENGTHS, RUN_LENGTHS, HOLE_SHARES_NEAR)
_FAR_BY_LENGTH = np.interp(_LENGTHS, RUN_LENGTHS, HOLE_SHARES_FAR)

# Right beside the occluder the texture decides: if the window's gradient is close to the image noise, the
# wrong match is not unique enough and is dropped; a strong outline in the window carries it across. Share
# of holes within 4 px by gradient / image noise, divided by their mean, on the same frames (on the real
# pair the shares are 0.72, 0.61, 0.57, 0.42, 0.30, 0.27 and 0.16).
NEAR_SNRS = (0.75, 1.5, 3.0, 6.0, 12.0, 24.0, 40.0)
NEAR_GAINS = (2.3, 1.8, 1.45, 1.3, 1.2, 0.8, 0.3)

# Values of the other hidden pixels, on the same pair: a tenth is right by chance, three quarters take the
# occluder's disparity, the others lie in between.
RIGHT_SHARE = 0.10
BETWEEN_SHARE = 0.15

# Right beside the occluder they always take its disparity; those shares apply from this distance on [px].
FREE_FROM = 4.0

# The occluder of a run is nearer by NEARER and at most SEARCH to its right [px]. It is not adjacent if the
# surface reappears beside a thin occluder, or where disparity has gaps.
NEARER = 1.0
SEARCH = 16

# Distance over which the matcher's decisions are correlated [px].
COHERENCE = 12.0


@dataclass(frozen=True)
class Occlusion:
    """Holes and confidently wrong depth on the left side of near objects."""

    name: ClassVar[str] = "occlusion"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if near objects hide anything from the right eye."""
        return choose_above(
            self.name,
            "occluded_share",
            facts.occluded_share,
            MIN_SHARE,
            "",
            on="near objects hide parts of the scene from the right eye: holes and wrong depth there",
            off="the right eye sees what the left eye sees",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Turn some hidden pixels into holes and give most others the disparity of the occluder.

        Below 1, ``strength`` is the share of the hidden pixels that are changed at all; above, it is the
        number of chances that each of them has to become a hole.
        """
        if strength <= 0:
            return sensed
        shape = truth.depth.shape
        runs = find_runs(truth.hidden)
        rows, columns, run = runs.pixels()

        at = rows * shape[1] + columns
        distance = runs.end[run] - columns

        touched = rng.random(len(rows)) < strength
        share = hole_share(runs.lengths[run], distance, truth.texture_snr.reshape(-1)[at])
        share = 1.0 - (1.0 - share) ** max(strength, 1.0)
        lost = coherent_uniform(rng, shape, rows, columns, COHERENCE) < share
        own = sensed.disparity.reshape(-1)[at]
        guess = np.full_like(own, np.nan)
        # The draw of a pixel does not depend on which others are drawn.
        kept = np.flatnonzero(~lost)
        drawn = coherent_uniform(rng, shape, rows[kept], columns[kept], COHERENCE)
        hiding = _hiding(sensed.disparity, runs)[run[kept]]
        guess[kept] = _guess(own[kept], hiding, distance[kept], drawn)
        changed = touched & (guess != own)
        # Wrong, and the sensor does not notice.
        confidence = np.where(np.isnan(guess), np.float32(0.0), np.float32(0.8))
        return sensed.with_pixels(at[changed], guess[changed], Cause.OCCLUDED, confidence[changed])


def hole_share(run_length: np.ndarray, distance: np.ndarray, snr: np.ndarray) -> np.ndarray:
    """Return the probability that a hidden pixel has no value, shape (n,).

    Args:
        run_length: of the hidden pixels in its row [px], whole numbers.
        distance: to the occluder, 1 for its neighbor [px].
        snr: gradient over image noise in the matching window.
    """
    length = np.minimum(run_length, RUN_LENGTHS[-1]).astype(np.intp)
    share = _FAR_BY_LENGTH[length]
    # The curve for near pixels counts only up to FAR_REACH.
    close = np.flatnonzero(distance < FAR_REACH)
    near = _NEAR_BY_LENGTH[length[close]] * np.interp(snr[close], NEAR_SNRS, NEAR_GAINS)
    away = np.maximum((distance[close] - NEAR_REACH) / (FAR_REACH - NEAR_REACH), 0.0)
    share[close] = near + (share[close] - near) * away
    return share


def _guess(
    own: np.ndarray, hiding: np.ndarray, distance: np.ndarray, drawn: np.ndarray
) -> np.ndarray:
    """Return the disparities that hidden pixels get; NaN where no occluder is found.

    Args:
        own: disparity before [px], (n,).
        hiding: the occluder's disparity [px], (n,), NaN: none.
        distance: to the occluder [px], (n,).
        drawn: uniform from 0 to 1, (n,).
    """
    # Near the occluder, dividing by a number below 1 makes all other outcomes rarer.
    drawn = drawn / np.minimum(distance / FREE_FROM, 1.0)
    between = own + (hiding - own) * (drawn - RIGHT_SHARE) / BETWEEN_SHARE
    guess = np.where(drawn < RIGHT_SHARE + BETWEEN_SHARE, between, hiding)
    return np.where(drawn < RIGHT_SHARE, own, guess)


def _hiding(disparity: np.ndarray, runs: Runs) -> np.ndarray:
    """Return the disparity of each run's occluder: the first nearer pixel to its right; NaN: none."""
    width = disparity.shape[1]
    found = np.full(len(runs.rows), np.nan, dtype=disparity.dtype)
    nearer_than = disparity[runs.rows, runs.end - 1] + NEARER
    for distance in range(SEARCH):
        wanted = np.flatnonzero(np.isnan(found) & (runs.end + distance < width))
        value = disparity[runs.rows[wanted], runs.end[wanted] + distance]
        nearer = value > nearer_than[wanted]
        found[wanted[nearer]] = value[nearer]
    return found
