"""Image noise of a camera: read noise and full well, from frames at rest.

In linear light the variance is x / W + r (`digs_warp.sim.sensor.color.image_noise`); in 8-bit steps it is
that times the squared slope of the sRGB curve, plus 1/12 for the rounding.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from digs_warp.data.images import linear_from_srgb
from digs_warp.sim.fit.estimate import BLOCKS, UNKNOWN, Estimate, block_numbers, jackknife
from digs_warp.sim.sensor.color.adaptation import MIDDLE_GREY
from digs_warp.sim.sensor.color.image_noise import STEPS_PER_LINEAR
from digs_warp.sim.sensor.filters import gray_of, horizontal_gradient

# Errors of the model beside the scatter, as shares: the curvature of sRGB and the rounding to whole steps, as
# far as 1/12 does not describe it, shift simulated recordings by half of this.
MODEL_ERROR, WELL_ERROR = 0.005, 0.02

# Darker and brighter values are clipped now and then, so that their noise looks smaller [DN].
DARKEST, BRIGHTEST = 12, 243

ROUNDING = 1 / 12  # variance of the rounding to whole steps [DN^2]

# Smaller noise between frames, rounding included, does not add to it: most pixels never change [DN].
LEAST = 0.55

# Where noise is that much larger on edges than on plain areas, the camera moved.
MOVED = 1.3

LEVELS = 256


@dataclass(frozen=True)
class ImageNoise:
    """Noise of the images.

    Attributes:
        temporal: mean standard deviation between frames [DN].
        mid_gray: of a mid-gray pixel, without the rounding [DN]: the rig's ``image_noise``.
        full_well: electrons of a white pixel.
        edges: noise where the image changes most over noise where it changes least; 1: at rest.
    """

    temporal: Estimate
    mid_gray: Estimate
    full_well: Estimate
    edges: float

    @property
    def is_hidden(self) -> bool:
        """Whether the rounding to 8 bits hides the noise."""
        return self.temporal.is_known and self.temporal.value < LEAST

    @property
    def is_still(self) -> bool:
        """Whether the camera was at rest."""
        return self.edges <= MOVED


NO_NOISE = ImageNoise(UNKNOWN, UNKNOWN, UNKNOWN, np.nan)


def image_noise(stacks: Sequence[np.ndarray]) -> ImageNoise:
    """Return the noise of images of a camera at rest.

    Differences of successive frames are compared, so that slow changes of the light do not count.

    Args:
        stacks: images of each pose, sRGB, (frames, height, width, 3), uint8; poses with one frame are not
            used.
    """
    stacks = [stack for stack in stacks if len(stack) > 1]
    if not stacks:
        return NO_NOISE
    plain, edges = (np.zeros((BLOCKS, 2 * LEVELS)) for _ in range(2))
    for stack in stacks:
        mean = stack.mean(axis=0)
        gradient = np.abs(horizontal_gradient(gray_of(np.rint(mean).astype(np.uint8))))
        steep = gradient > np.median(gradient)
        plain += _level_sums(stack, mean, ~steep)
        edges += _level_sums(stack, mean, steep)
    # Half of the image is plain enough that a shake of the camera hardly shows.
    return ImageNoise(
        temporal=jackknife(plain, lambda s: s[:LEVELS].sum() / s[LEVELS:].sum()).root(),
        mid_gray=_with_model(jackknife(plain, _mid_gray_variance).root(), MODEL_ERROR),
        full_well=_full_well(plain),
        edges=_edge_ratio(plain.sum(axis=0), edges.sum(axis=0)),
    )


def _level_sums(stack: np.ndarray, mean: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Return, by block, the summed variance at each gray level, then the number of values."""
    blocks = block_numbers(stack.shape[1:3])[where]
    index = (blocks[:, None] * LEVELS + np.rint(mean[where]).astype(int)).ravel()
    variances, counts = (np.zeros(BLOCKS * LEVELS) for _ in range(2))
    for first, second in pairwise(stack):
        change = first[where].astype(np.float64) - second[where]
        change -= change.mean(axis=0)
        variances += np.bincount(index, (0.5 * change**2).ravel(), BLOCKS * LEVELS)
        counts += np.bincount(index, minlength=BLOCKS * LEVELS)
    return np.concatenate([x.reshape(BLOCKS, LEVELS) for x in (variances, counts)], axis=1)


def _edge_ratio(plain: np.ndarray, edges: np.ndarray) -> float:
    """Return the ratio of noise at the same gray levels on edges and on plain areas."""
    weight = np.minimum(plain[LEVELS:], edges[LEVELS:])
    with np.errstate(divide="ignore", invalid="ignore"):
        means = [np.nan_to_num(x[:LEVELS] / x[LEVELS:]) for x in (plain, edges)]
    at_plain, at_edges = (float((mean * weight).sum()) for mean in means)
    return float(np.sqrt(at_edges / at_plain)) if at_plain > 0 else np.nan


def _mid_gray_variance(sums: np.ndarray) -> float:
    shot, read = _shot_and_read(sums)
    return STEPS_PER_LINEAR**2 * (shot * MIDDLE_GREY + read)


def _full_well(sums: np.ndarray) -> Estimate:
    shot = jackknife(sums, lambda s: _shot_and_read(s)[0])
    if not shot.value > 0:
        return UNKNOWN
    return _with_model(Estimate(1 / shot.value, shot.error / shot.value**2), WELL_ERROR)


def _with_model(estimate: Estimate, share: float) -> Estimate:
    return Estimate(estimate.value, float(np.hypot(estimate.error, share * estimate.value)))


def _shot_and_read(sums: np.ndarray) -> np.ndarray:
    """Return variance of shot noise at white and of read noise, in linear light, by a weighted fit."""
    from scipy.optimize import nnls

    levels = np.arange(DARKEST, BRIGHTEST)
    counts = sums[LEVELS:][levels]
    levels, counts = levels[counts > 0], counts[counts > 0]
    if len(levels) < 2:
        return np.full(2, np.nan)
    measured = np.maximum(sums[levels] / counts - ROUNDING, 0.0)
    linear, slope = _linear_and_slope()
    terms = np.stack([linear[levels], np.ones(len(levels))], axis=1) * slope[levels, None] ** 2
    found, expected = np.zeros(2), np.full(len(levels), max(measured.mean(), 1e-6))
    # The spread of a variance is proportional to it, which the fit itself tells.
    for _ in range(4):
        weight = np.sqrt(counts) / (expected + ROUNDING)
        found = nnls(terms * weight[:, None], measured * weight)[0]
        expected = terms @ found
    return found


@cache
def _linear_and_slope() -> tuple[np.ndarray, np.ndarray]:
    """Return the linear light of each gray level, and 8-bit steps per unit of linear light there."""
    linear = linear_from_srgb(np.arange(LEVELS) / 255.0)
    return linear, 1 / np.gradient(linear)
